//! The markup of rich text, read in one place: for setting it in type, for HTML, and for plain
//! text.
//!
//! `*x*` is italic; `^{...}` and `_{...}` raise and lower (one character needs no braces); a
//! backslash takes the next character literally. A hyphen before a number or inside a superscript
//! or subscript is a minus sign.

/// An element of a text, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Token {
    /// A character.
    Sign(char),
    /// A minus sign, written as a hyphen.
    Minus,
    /// Italics begin or end.
    Italic,
    /// A superscript begins.
    Raise,
    /// A subscript begins.
    Lower,
    /// Braces open that belong to no script.
    Group,
    /// A superscript, subscript or group ends.
    End,
}

/// An error in a text's markup.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MarkupError {
    /// Braces do not match, or a script has nothing in it to raise or lower.
    #[error("unbalanced braces; write \\{{ for a brace")]
    Braces,
    /// An italic passage is not closed.
    #[error("an asterisk without its partner; write \\* for an asterisk")]
    Italic,
}

/// Reads a text.
///
/// # Errors
/// [`MarkupError`] if braces or asterisks do not match.
pub fn parse(text: &str) -> Result<Vec<Token>, MarkupError> {
    let characters: Vec<char> = text.chars().collect();
    let at = |i: usize| characters.get(i).copied();
    let mut tokens = Vec::with_capacity(characters.len());
    let (mut depth, mut italic, mut next) = (0_usize, false, 0);
    while let Some(c) = at(next) {
        next += 1;
        match c {
            '\\' => {
                tokens.push(Token::Sign(at(next).unwrap_or('\\')));
                next += 1;
            }
            '*' => {
                italic = !italic;
                tokens.push(Token::Italic);
            }
            '^' | '_' => {
                tokens.push(if c == '^' { Token::Raise } else { Token::Lower });
                match at(next).ok_or(MarkupError::Braces)? {
                    '{' => depth += 1,
                    '-' => tokens.extend([Token::Minus, Token::End]),
                    one => tokens.extend([Token::Sign(one), Token::End]),
                }
                next += 1;
            }
            '{' => {
                depth += 1;
                tokens.push(Token::Group);
            }
            '}' => {
                depth = depth.checked_sub(1).ok_or(MarkupError::Braces)?;
                tokens.push(Token::End);
            }
            '-' if depth > 0 || is_minus(next.checked_sub(2).and_then(at), at(next)) => {
                tokens.push(Token::Minus)
            }
            other => tokens.push(Token::Sign(other)),
        }
    }
    match (depth, italic) {
        (0, false) => Ok(tokens),
        (0, true) => Err(MarkupError::Italic),
        _ => Err(MarkupError::Braces),
    }
}

/// A hyphen is a minus sign before a digit, unless it joins words or numbers such as `2-10`; and
/// between spaces.
fn is_minus(before: Option<char>, after: Option<char>) -> bool {
    let joins = before.is_some_and(char::is_alphanumeric);
    (!joins && after.is_some_and(|c| c.is_ascii_digit() || c == '.' || c == '*'))
        || (before == Some(' ') && after == Some(' '))
}

/// The text without its markup, for readers without typesetting: scripts keep their sign, minus
/// signs stay hyphens. A text whose markup is faulty only loses asterisks and braces.
pub fn plain(text: &str) -> String {
    let Ok(tokens) = parse(text) else { return text.replace(['*', '{', '}'], "") };
    let mut plain = String::with_capacity(text.len());
    for token in tokens {
        match token {
            Token::Sign(c) => plain.push(c),
            Token::Minus => plain.push('-'),
            Token::Raise => plain.push('^'),
            Token::Lower => plain.push('_'),
            Token::Italic | Token::Group | Token::End => {}
        }
    }
    plain
}

/// A text in which nothing is markup: what a user's file says, as it stands there.
pub fn literal(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        if matches!(c, '*' | '^' | '_' | '{' | '}' | '\\') {
            out.push('\\');
        }
        // The embedded fonts have no control characters.
        out.push(if c.is_control() { ' ' } else { c });
    }
    out
}

/// Names of Greek letters, as programs spell them.
const GREEK: [(&str, char); 24] = [
    ("alpha", 'α'),
    ("beta", 'β'),
    ("gamma", 'γ'),
    ("delta", 'δ'),
    ("epsilon", 'ε'),
    ("eps", 'ε'),
    ("zeta", 'ζ'),
    ("eta", 'η'),
    ("theta", 'θ'),
    ("kappa", 'κ'),
    ("lambda", 'λ'),
    ("mu", 'μ'),
    ("nu", 'ν'),
    ("xi", 'ξ'),
    ("rho", 'ρ'),
    ("sigma", 'σ'),
    ("tau", 'τ'),
    ("phi", 'φ'),
    ("chi", 'χ'),
    ("psi", 'ψ'),
    ("omega", 'ω'),
    ("Gamma", 'Γ'),
    ("Delta", 'Δ'),
    ("Omega", 'Ω'),
];

/// A program's name for a quantity, as mathematics sets it: `omega` is an italic ω, `v_plus` and
/// `x1` have subscripts.
pub fn name(name: &str) -> String {
    let letters = name.trim_end_matches(|c: char| c.is_ascii_digit());
    let (base, script) = match name.split_once('_') {
        Some((base, script)) if !base.is_empty() && !script.is_empty() => (base, script),
        _ if !letters.is_empty() && !letters.ends_with('_') => (letters, &name[letters.len()..]),
        _ => (name, ""),
    };
    let base = match GREEK.iter().find(|(word, _)| *word == base) {
        Some((_, letter)) => letter.to_string(),
        None => literal(base),
    };
    if script.is_empty() {
        format!("*{base}*")
    } else {
        format!("*{base}*_{{{}}}", literal(script))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_quantities() {
        let pairs = [
            ("x", "*x*"),
            ("omega", "*ω*"),
            ("omega0", "*ω*_{0}"),
            ("v_plus", "*v*_{plus}"),
            ("a_b_c", "*a*_{b\\_c}"),
            ("prey", "*prey*"),
            ("x1", "*x*_{1}"),
            ("x_", "*x\\_*"),
        ];
        for (given, want) in pairs {
            assert_eq!(name(given), want);
            assert!(parse(&name(given)).is_ok());
        }
        assert_eq!(plain(&literal("a*b_{c}^\\ -1")), "a*b_{c}^\\ -1");
    }

    #[test]
    fn hyphens_and_minus_signs() {
        let minus =
            |text: &str| parse(text).unwrap().iter().filter(|t| **t == Token::Minus).count();
        for (text, count) in [
            ("-1.2", 1),
            ("*v* = -1.2", 1),
            ("2-10", 0),
            ("two-fold", 0),
            ("a - b", 1),
            ("10^{-5}", 1),
            ("x^-", 1),
            ("\\-1", 0),
        ] {
            assert_eq!(minus(text), count, "{text}");
        }
    }

    #[test]
    fn scripts_end() {
        use Token::{End, Italic, Lower, Minus, Raise, Sign};
        assert_eq!(
            parse("*v*_{+}10^{-5}").unwrap(),
            [
                Italic,
                Sign('v'),
                Italic,
                Lower,
                Sign('+'),
                End,
                Sign('1'),
                Sign('0'),
                Raise,
                Minus,
                Sign('5'),
                End
            ]
        );
        assert_eq!(parse("x^2").unwrap(), [Sign('x'), Raise, Sign('2'), End]);
    }

    #[test]
    fn faults_are_named() {
        for text in ["a_{b", "a}", "a^", "{"] {
            assert_eq!(parse(text), Err(MarkupError::Braces), "{text}");
        }
        assert_eq!(parse("*a"), Err(MarkupError::Italic));
    }

    #[test]
    fn plain_text() {
        assert_eq!(plain("*ε* = 10^{-3}, -1.2, \\*"), "ε = 10^-3, -1.2, *");
        assert_eq!(plain("*a"), "a");
    }
}
