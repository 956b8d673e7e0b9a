use super::*;
use proptest::prelude::*;
use twofold_num::tape::{Program, Recorded, Tape};

const NAMES: [&str; 3] = ["x", "alpha", "v_plus"];

fn value(text: &str) -> f64 {
    let mut name = |n: &str| if n == "x" { 3.0 } else { 0.5 };
    Expression::parse(text, &NAMES)
        .unwrap_or_else(|e| panic!("{text}: {e}"))
        .evaluate(&mut name, &Decimal::value)
}

#[test]
fn precedence_is_that_of_mathematics() {
    for (text, want) in [
        ("-x^2", -9.0),
        ("(-x)^2", 9.0),
        ("2^3^2", 512.0),
        ("x^-2", 1.0 / 9.0),
        ("1 - 2 - 3", -4.0),
        ("24/4/2", 3.0),
        ("24/4*2", 12.0),
        ("2*-x", -6.0),
        ("--x", 3.0),
        ("1e-3*x + .5", 1e-3 * 3.0 + 0.5),
        ("2.*pi", 2.0 * std::f64::consts::PI),
        ("abs(-x) + sign(x) + tan(0)", 4.0),
        ("x^(1+1)", 9.0),
        ("x^0", 1.0),
    ] {
        assert_eq!(value(text), want, "{text}");
    }
}

/// (text, marked part, message, help)
const WRONG: [(&str, &str, &str, &str); 34] = [
    ("max(x, 0)", "max", "no function `max`", "(a + b + abs(a - b))/2"),
    ("1 + min(x, max(x, 1))", "min", "no function `min`", "(a + b - abs(a - b))/2"),
    ("mod(x, 1)", "mod", "no function `mod`", "cosine c and sine s"),
    ("Heaviside(x)", "Heaviside", "no function `Heaviside`", "(1 + sign(x))/2"),
    ("sin(x, alpha)", "sin", "has one argument; 2 are given", "sin(a)"),
    ("tanh()", "tanh", "has one argument; none is given", "tanh(a)"),
    ("exp((x, 1))", ",", "no meaning", "point"),
    ("1 + aplha*x", "aplha", "unknown name `aplha`", "did you mean `alpha`?"),
    ("V_plus", "V_plus", "unknown name `V_plus`", "did you mean `v_plus`?"),
    ("sin(t)", "t", "unknown name `t`", "derivative 1"),
    ("qqq", "qqq", "unknown name `qqq`", "known here: x, alpha, v_plus"),
    ("tnah(x)", "tnah", "no function `tnah`", "did you mean `tanh`?"),
    ("log(x)", "log", "no function `log`", "ln(x)"),
    ("2x", "x", "operator is missing", "2*x"),
    ("(x)(x)", "(", "operator is missing", "(...)*("),
    ("(1 + x", "(", "never closed", "add a `)`"),
    ("sin(x", "(", "never closed", "add a `)`"),
    ("1 + x)", ")", "never opened", ""),
    ("x**2", "**", "not an operator", "x^2"),
    ("x^alpha", "alpha", "whole number", "exp(p*ln(x))"),
    ("x^0.5", "0.5", "whole number", "sqrt(x)"),
    ("x^65", "65", "too large", ""),
    ("x +", "", "ends where", ""),
    ("x * / 2", "/", "two operators", ""),
    ("()", ")", "missing before this", ""),
    ("", "", "empty", "write 0"),
    ("|x|", "|", "no meaning", "abs(x)"),
    ("x > 0", ">", "no meaning", "do not branch"),
    ("1,5", ",", "no meaning", "point"),
    ("1e", "1e", "exponent", "1e-3"),
    ("1e400", "1e400", "outside the range", ""),
    ("sin + 1", "sin", "needs its argument", "sin(...)"),
    ("1.2.3", ".3", "operator is missing", ""),
    ("α*x", "α", "no meaning", "letters a-z"),
];

#[test]
fn errors_point_and_advise() {
    for (text, marked, message, help) in WRONG {
        let error = Expression::parse(text, &NAMES).expect_err(text);
        assert_eq!(&text[error.span.clone()], marked, "{text}: {error:?}");
        assert!(error.message.contains(message), "{text}: {error:?}");
        assert!(error.help.clone().unwrap_or_default().contains(help), "{text}: {error:?}");
    }
    let constant = Expression::parse_general("k", &[]).expect_err("there are no names");
    assert!(constant.help.is_some_and(|help| help.contains("no names are known here")));
}

/// (text, how it is printed)
const GENERAL: [(&str, &str); 20] = [
    ("max(x, 0, alpha)", "max(x, 0, alpha)"),
    ("x < 1", "1 > x"),
    ("x >= 1", "not 1 > x"),
    ("x <= 1", "not x > 1"),
    ("not x > 0 and t < 1 or alpha > 0", "not x > 0 and 1 > t or alpha > 0"),
    ("not (x > 0 and (t < 1 or alpha > 0))", "not (x > 0 and (1 > t or alpha > 0))"),
    ("(x > 0)*(1 - x)", "(x > 0)*(1 - x)"),
    ("x + 1 > alpha*2", "x + 1 > alpha*2"),
    ("if((x > 0), 1, -1)", "if(x > 0, 1, -1)"),
    ("if(x > 0, if(t > 1, 2, 3), 4)", "if(x > 0, if(t > 1, 2, 3), 4)"),
    ("mod(t/2, 1)", "mod(t/2, 1)"),
    ("clip(x, -1, 1)^2", "clip(x, -1, 1)^2"),
    ("x^alpha", "x^alpha"),
    ("x^-0.5", "x^-0.5"),
    ("x^(1/3)", "x^(1/3)"),
    ("x^alpha^2", "x^alpha^2"),
    ("-x^0.5", "-x^0.5"),
    ("atan2(x, alpha) - log10(x)*log(x)", "atan2(x, alpha) - log10(x)*log(x)"),
    ("sinh(x) + cosh(x) + asin(x) + acos(x)", "sinh(x) + cosh(x) + asin(x) + acos(x)"),
    ("heaviside(floor(x) - min(t, 1))", "heaviside(floor(x) - min(t, 1))"),
];

#[test]
fn general_expressions_are_read_and_printed() {
    for (text, want) in GENERAL {
        let parsed =
            Expression::parse_general(text, &NAMES).unwrap_or_else(|e| panic!("{text}: {e}"));
        assert_eq!(parsed.to_string(), want);
        assert_eq!(Expression::parse_general(want, &NAMES), Ok(parsed));
    }
}

/// (text, marked part, message, help)
const WRONG_IN_GENERAL: [(&str, &str, &str, &str); 19] = [
    ("x > 0 && t > 1", "&", "no meaning", "`and`"),
    ("x > 0 ? 1 : 2", "?", "no meaning", "if(condition, a, b)"),
    ("if(x == 0, 1, 2)", "=", "equality", "[[event]]"),
    ("if(x, 1, 2)", "x", "a condition is wanted", "x > 0"),
    ("if(x > 0, 1)", "if", "3 arguments; 2 given", "if(x > 0, a, b)"),
    ("not x", "x", "a condition is wanted", "x > 0"),
    ("x > 0 and alpha", "alpha", "a condition is wanted", "x > 0"),
    ("x or alpha > 0", "x", "a condition is wanted", "x > 0"),
    ("0 < x < 1", "<", "two comparisons", "0 < x and x < 1"),
    ("max(x)", "max", "2 arguments or more; 1 given", ""),
    ("mod(x, 1, 2)", "mod", "2 arguments; 3 given", ""),
    ("floor + 1", "floor", "needs its arguments", "floor(...)"),
    ("clip(x, 0, 1", "(", "never closed", "add a `)`"),
    ("Max(x, 0)", "Max", "no function `Max`", "did you mean `max`?"),
    ("ceil(x)", "ceil", "no function `ceil`", "-floor(-x)"),
    ("step(x)", "step", "no function `step`", "heaviside(x)"),
    ("cbrt(x)", "cbrt", "no function `cbrt`", "exp(ln(abs(x))/3)"),
    ("frob(x)", "frob", "no function `frob`", "heaviside"),
    ("x^65", "65", "too large", ""),
];

#[test]
fn errors_in_general_expressions_point_and_advise() {
    for (text, marked, message, help) in WRONG_IN_GENERAL {
        let error = Expression::parse_general(text, &NAMES).expect_err(text);
        assert_eq!(&text[error.span.clone()], marked, "{text}: {error:?}");
        assert!(error.message.contains(message), "{text}: {error:?}");
        assert!(error.help.clone().unwrap_or_default().contains(help), "{text}: {error:?}");
    }
    for name in ["max", "min", "mod", "floor", "if", "heaviside", "clip"] {
        let help = Expression::parse(&format!("{name}(x)"), &NAMES).unwrap_err().help.unwrap();
        assert!(help.contains(&format!("a system written as f = [...] has {name}")), "{help}");
    }
}

#[test]
fn bounds() {
    let message = |text: &str| Expression::parse(text, &NAMES).unwrap_err().message;
    assert!(message(&"(".repeat(100)).contains("64 levels"));
    assert!(message(&"-".repeat(100)).contains("64 levels"));
    assert!(message(&format!("x{}", "^2".repeat(100))).contains("64 levels"));
    assert!(message(&"x+".repeat(1000)).contains("1000 terms"));
    assert!(message(&" ".repeat(5000)).contains("4096"));
    // The longest chain that is allowed does not exhaust the stack.
    let long = vec!["x"; 500].join("+");
    assert_eq!(value(&long), 1500.0);
}

fn any_expression() -> impl Strategy<Value = Expression> {
    let leaf = prop_oneof![
        (0.0..100.0_f64).prop_map(|v| Expression::Number(v.into())),
        Just(Expression::Number("0.12345678901234567890123".parse().unwrap())),
        Just(Expression::Number(1e-30.into())),
        Just(Expression::Pi),
        Just(Expression::Name("x".into())),
        Just(Expression::Name("alpha".into())),
    ];
    leaf.prop_recursive(6, 40, 2, |inner| {
        let pair = (inner.clone(), inner.clone()).prop_map(|(a, b)| (Box::new(a), Box::new(b)));
        prop_oneof![
            inner.clone().prop_map(|a| Expression::Neg(Box::new(a))),
            pair.clone().prop_map(|(a, b)| Expression::Add(a, b)),
            pair.clone().prop_map(|(a, b)| Expression::Sub(a, b)),
            pair.clone().prop_map(|(a, b)| Expression::Mul(a, b)),
            pair.prop_map(|(a, b)| Expression::Div(a, b)),
            (inner.clone(), -5..6).prop_map(|(a, n)| Expression::Power(Box::new(a), n)),
            (inner, 0..Function::ALL.len())
                .prop_map(|(a, i)| Expression::Call(Function::ALL[i].1, Box::new(a))),
        ]
    })
}

/// Also what only general systems may say.
fn any_general_expression() -> impl Strategy<Value = Expression> {
    let condition = |e: Expression| match e.is_condition() {
        true => Box::new(e),
        false => Box::new(Expression::Greater(Box::new(e), Box::new(Expression::Pi))),
    };
    let leaf = prop_oneof![any_expression(), Just(Expression::Name("t".into()))];
    leaf.prop_recursive(4, 60, 4, move |inner| {
        let pair = (inner.clone(), inner.clone());
        let function = (0..General::ALL.len(), prop::collection::vec(inner.clone(), 5), 0..3_usize);
        prop_oneof![
            pair.clone().prop_map(|(a, b)| Expression::Greater(Box::new(a), Box::new(b))),
            pair.clone().prop_map(move |(a, b)| Expression::And(condition(a), condition(b))),
            pair.clone().prop_map(move |(a, b)| Expression::Or(condition(a), condition(b))),
            inner.clone().prop_map(move |a| Expression::Not(condition(a))),
            pair.clone().prop_map(|(a, b)| Expression::Mul(Box::new(a), Box::new(b))),
            pair.clone().prop_map(|(a, b)| Expression::Sub(Box::new(a), Box::new(b))),
            // A whole exponent is another kind of power.
            pair.prop_filter("whole", |(_, b)| whole(b).is_none())
                .prop_map(|(a, b)| Expression::RealPower(Box::new(a), Box::new(b))),
            function.prop_map(move |(i, mut list, more)| {
                let (_, function, counts) = General::ALL[i].clone();
                list.truncate((counts.start + more).min(counts.end - 1));
                if function == General::If {
                    list[0] = *condition(list[0].clone());
                }
                Expression::Apply(function, list)
            }),
        ]
    })
}

fn tape(expression: &Expression) -> Tape {
    Tape::record(1, |x| {
        let mut name = |n: &str| if n == "x" { x[0] } else { Recorded::parameter(n, &0.5.into()) };
        vec![expression.evaluate(&mut name, &Recorded::constant)]
    })
}

/// Signs of expressions, or any.
fn any_text() -> impl Strategy<Value = String> {
    let signs = "-+*/^()x0123456789.e|abcdfghijklmnopqrstuvwyz ".chars().collect::<Vec<_>>();
    let of_signs = prop::collection::vec(prop::sample::select(signs), 0..=60);
    let of_any = prop::collection::vec(any::<char>(), 0..=30);
    prop_oneof![of_signs, of_any].prop_map(String::from_iter)
}

proptest! {
    #[test]
    fn printing_and_parsing_give_the_expression_back(expression in any_expression()) {
        let text = expression.to_string();
        let parsed = Expression::parse(&text, &NAMES);
        prop_assert_eq!(parsed.as_ref(), Ok(&expression), "{}", text);
        prop_assert_eq!(tape(&parsed.unwrap()), tape(&expression));
    }

    #[test]
    fn printing_and_parsing_give_the_general_expression_back(
        expression in any_general_expression()
    ) {
        let text = expression.to_string();
        prop_assume!(text.len() <= MAX_LENGTH);
        prop_assert_eq!(Expression::parse_general(&text, &NAMES), Ok(expression), "{}", text);
    }

    #[test]
    fn the_tape_gives_the_bits_of_plain_evaluation(expression in any_expression(),
        x in -3.0..3.0_f64) {
        let mut name = |n: &str| if n == "x" { x } else { 0.5 };
        let want = expression.evaluate(&mut name, &Decimal::value);
        let mut out = [0.0];
        Program::new(&tape(&expression)).evaluate(&[x], &mut out);
        prop_assert!(out[0].to_bits() == want.to_bits() || out[0].is_nan() && want.is_nan(),
            "{} {}", out[0], want);
    }

    #[test]
    fn no_text_panics(text in any_text()) {
        for error in [Expression::parse(&text, &NAMES), Expression::parse_general(&text,
            &NAMES)].into_iter().filter_map(Result::err) {
            prop_assert!(text.get(error.span).is_some());
        }
    }
}
