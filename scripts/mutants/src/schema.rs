//! Finds what can be mutated in a file, and writes the file with every mutant in it, each switched on by its number.
//!
//! Nothing is evaluated twice and nothing is copied: an operator's operands become the names `l__` and `r__` of a `match`, so the text
//! grows by a constant for each mutant however deep expressions nest, and temporaries live as long as they did.

use std::collections::BTreeSet;
use std::ops::Range;

use syn::punctuated::Punctuated;
use syn::spanned::Spanned;
use syn::visit::{self, Visit};
use syn::{BinOp, Expr, ReturnType, Token, Type, UnOp};

/// What a site in the text is, and the texts of its parts.
#[derive(Debug)]
enum Kind {
    /// `l op r`, operands taken by value.
    Value { left: Range<usize>, op: String, right: Range<usize> },
    /// `l op r` of a comparison, operands taken by reference; whether the mutant would answer otherwise is known without running it.
    Compare { left: Range<usize>, op: String, right: Range<usize> },
    /// `&&` or `||`.
    Short { left: Range<usize>, or: bool, right: Range<usize> },
    /// `l op= r`.
    Assign { left: Range<usize>, op: String, right: Range<usize> },
    /// `-x` or `!x`.
    Unary { op: String, operand: Range<usize> },
    /// A match guard: replaced by true, by false, its arm deleted.
    Guard { arm: bool },
    /// An arm without a guard, deleted.
    Arm,
    /// A function's body, replaced by values.
    Body,
}

/// A place in the text with its mutants.
#[derive(Debug)]
struct Site {
    kind: Kind,
    range: Range<usize>,
    parent: Option<usize>,
    /// Its mutants: where the first stands in [`File::mutants`], and how many there are.
    first: usize,
    count: usize,
}

/// One mutant.
#[derive(Debug, Clone)]
pub struct Mutant {
    /// Path of the file from the package's root.
    pub file: String,
    pub line: usize,
    pub column: usize,
    /// The function it stands in, with its type.
    pub function: String,
    /// What is replaced.
    pub original: String,
    /// And by what.
    pub replacement: String,
    /// The text of the alternative, for bodies.
    value: String,
}

impl Mutant {
    /// Names it, whatever else is mutated.
    pub fn key(&self) -> String {
        format!(
            "{}:{}:{}: {} -> {} in {}",
            self.file, self.line, self.column, self.original, self.replacement, self.function
        )
    }
}

/// A file's text and its sites.
pub struct File {
    text: String,
    sites: Vec<Site>,
    pub mutants: Vec<Mutant>,
    /// Modules in files of their own that are only built for tests.
    pub tests: Vec<String>,
}

impl File {
    pub fn scan(path: &str, text: String) -> Result<Self, syn::Error> {
        let tree = syn::parse_file(&text)?;
        let mut finder = Finder {
            path,
            text: &text,
            sites: Vec::new(),
            mutants: Vec::new(),
            open: Vec::new(),
            names: Vec::new(),
            deletable: false,
        };
        finder.visit_file(&tree);
        let Finder { sites, mutants, .. } = finder;
        let tests = tree.items.iter().filter_map(|item| match item {
            syn::Item::Mod(module) if module.content.is_none() && skipped(&module.attrs) => {
                Some(module.ident.to_string())
            }
            _ => None,
        });
        let tests = tests.collect();
        Ok(Self { text, sites, mutants, tests })
    }

    /// The text with its mutants; the first has the number `offset`. Those whose place in `mutants` is in `dropped` are left out.
    pub fn render(&self, offset: usize, dropped: &BTreeSet<usize>) -> String {
        self.part(0..self.text.len(), None, offset, dropped)
    }

    fn part(&self, range: Range<usize>, parent: Option<usize>, offset: usize, dropped: &BTreeSet<usize>) -> String {
        let mut inside: Vec<usize> = (0..self.sites.len())
            .filter(|i| {
                let s = &self.sites[*i];
                s.parent == parent && range.start <= s.range.start && s.range.end <= range.end
            })
            .collect();
        inside.sort_by_key(|i| (self.sites[*i].range.start, self.sites[*i].range.end, *i));
        let (mut out, mut at) = (String::new(), range.start);
        for i in inside {
            let site = &self.sites[i];
            out.push_str(&self.text[at..site.range.start]);
            out.push_str(&self.site(i, offset, dropped));
            at = site.range.end;
        }
        out.push_str(&self.text[at..range.end]);
        out
    }

    fn site(&self, index: usize, offset: usize, dropped: &BTreeSet<usize>) -> String {
        let site = &self.sites[index];
        let part = |range: &Range<usize>| self.part(range.clone(), Some(index), offset, dropped);
        let viable: Vec<usize> = (site.first..site.first + site.count).filter(|m| !dropped.contains(m)).collect();
        if viable.is_empty() {
            return match &site.kind {
                Kind::Body | Kind::Arm => String::new(),
                _ => part(&site.range),
            };
        }
        let number = |m: usize| m + offset;
        let (low, high) = (number(site.first), number(site.first + site.count - 1));
        // One branch for what was written, one for each mutant.
        let branches = |original: String, of: &dyn Fn(&Mutant) -> String| {
            let mut out = format!("if crate::mutation::off({low}, {high}) {{ {original} }}");
            for (n, m) in viable.iter().enumerate() {
                let condition = if n + 1 < viable.len() {
                    format!("if crate::mutation::on({}) ", number(*m))
                } else {
                    String::new()
                };
                out += &format!(" else {condition}{{ {} }}", marked(number(*m), &of(&self.mutants[*m])));
            }
            out
        };
        let text = match &site.kind {
            Kind::Value { left, op, right } => {
                let inner = branches(format!("l__ {op} r__"), &|m| format!("l__ {} r__", m.replacement));
                format!("(match ({}, {}) {{ (l__, r__) => {inner} }})", part(left), part(right))
            }
            Kind::Compare { left, op, right } => {
                let mut inner = format!("l__ {op} r__");
                for m in &viable {
                    let other = marked(number(*m), &format!("l__ {} r__", self.mutants[*m].replacement));
                    inner = format!("crate::mutation::alt({}, {inner}, || {other})", number(*m));
                }
                format!("(match (&({}), &({})) {{ (l__, r__) => {inner} }})", part(left), part(right))
            }
            Kind::Short { left, or, right } => {
                let on = format!("crate::mutation::on({low})");
                let condition = if *or { format!("l__ == {on}") } else { format!("l__ ^ {on}") };
                format!("(match ({}) {{ l__ => if {condition} {{ {} }} else {{ l__ }} }})", part(left), part(right))
            }
            Kind::Assign { left, op, right } => {
                let place = part(left);
                let inner = branches(format!("{place} {op} r__"), &|m| format!("{place} {} r__", m.replacement));
                format!("(match ({}) {{ r__ => {inner} }})", part(right))
            }
            Kind::Unary { op, operand } => {
                let inner = branches(format!("{op}l__"), &|_| "l__".into());
                format!("(match ({}) {{ l__ => {inner} }})", part(operand))
            }
            Kind::Guard { arm } => {
                let guard = part(&site.range);
                let mut inner = guard;
                for m in &viable {
                    let to = &self.mutants[*m].replacement;
                    if to == "true" || to == "false" {
                        inner = format!("crate::mutation::alt({}, {inner}, || {to})", number(*m));
                    }
                }
                let deletion = low + 2;
                if *arm && viable.contains(&(site.first + 2)) {
                    format!("!crate::mutation::on({deletion}) && ({inner})")
                } else {
                    inner
                }
            }
            Kind::Arm => format!(" if !crate::mutation::on({low})"),
            Kind::Body => viable
                .iter()
                .map(|m| {
                    let value = &self.mutants[*m].value;
                    let value = marked(number(*m), &format!("return {value};"));
                    format!(" if crate::mutation::on({}) {{ {value} }}", number(*m))
                })
                .collect(),
        };
        format!("/*s{low}(*/{text}/*)s{low}*/")
    }

    /// All mutants of the site whose first has the place `first`.
    pub fn of_site(&self, first: usize) -> Range<usize> {
        self.sites.iter().find(|s| s.first == first && s.count > 0).map_or(first..first, |s| s.first..s.first + s.count)
    }
}

fn marked(number: usize, text: &str) -> String {
    format!("/*m{number}(*/{text}/*)m{number}*/")
}

struct Finder<'a> {
    path: &'a str,
    text: &'a str,
    sites: Vec<Site>,
    mutants: Vec<Mutant>,
    /// The sites that the visit is inside of.
    open: Vec<usize>,
    names: Vec<String>,
    /// Whether the arms of the match at hand can be deleted.
    deletable: bool,
}

impl Finder<'_> {
    fn source(&self, node: &impl Spanned) -> String {
        self.text[node.span().byte_range()].split_whitespace().collect::<Vec<_>>().join(" ")
    }

    /// Adds a site at `range` with mutants of `original` seen at `place`; then visits what is inside.
    fn site(
        &mut self,
        kind: Kind,
        range: Range<usize>,
        place: proc_macro2::LineColumn,
        original: &str,
        replacements: &[(String, String)],
        inside: impl FnOnce(&mut Self),
    ) {
        let site = Site {
            kind,
            range,
            parent: self.open.last().copied(),
            first: self.mutants.len(),
            count: replacements.len(),
        };
        for (replacement, value) in replacements {
            self.mutants.push(Mutant {
                file: self.path.into(),
                line: place.line,
                column: place.column + 1,
                function: self.names.join("::"),
                original: original.into(),
                replacement: replacement.clone(),
                value: value.clone(),
            });
        }
        self.sites.push(site);
        self.open.push(self.sites.len() - 1);
        inside(self);
        self.open.pop();
    }

    fn function(
        &mut self,
        attributes: &[syn::Attribute],
        signature: &syn::Signature,
        block: &syn::Block,
        visit: impl FnOnce(&mut Self),
    ) {
        if skipped(attributes) || signature.constness.is_some() || attributes.iter().any(|a| a.path().is_ident("test"))
        {
            return;
        }
        self.names.push(signature.ident.to_string());
        let body = block.span().byte_range();
        let original = self.text[body.start + 1..body.end - 1].trim();
        let values: Vec<(String, String)> = match &signature.output {
            ReturnType::Default => vec!["()".to_owned()],
            ReturnType::Type(_, ty) => values(ty),
        }
        .into_iter()
        .filter(|v| v != original && !(v == "()" && original.is_empty()))
        .map(|v| (v.clone(), v))
        .collect();
        let at = block.brace_token.span.open().byte_range().end;
        if !values.is_empty() {
            let place = signature.ident.span().start();
            self.site(Kind::Body, at..at, place, "body", &values, |_| ());
        }
        visit(self);
        self.names.pop();
    }
}

/// Test code, code of other systems, and what says that it is no code of ours.
fn skipped(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().any(|a| {
        a.path().is_ident("cfg") && {
            let text = match &a.meta {
                syn::Meta::List(list) => list.tokens.to_string().replace(' ', ""),
                _ => String::new(),
            };
            text.contains("test") && !text.contains("not(test") || text.contains("windows") || text.contains("not(unix")
        }
    })
}

/// Values of a type that a function may return instead of what it computes: those of cargo-mutants.
fn values(ty: &Type) -> Vec<String> {
    let default = || vec!["Default::default()".to_owned()];
    let each = |values: Vec<String>, wrap: &dyn Fn(&str) -> String| values.iter().map(|v| wrap(v)).collect::<Vec<_>>();
    match ty {
        Type::Path(path) => {
            let Some(last) = path.path.segments.last() else { return default() };
            let mut inner = Vec::new();
            if let syn::PathArguments::AngleBracketed(list) = &last.arguments {
                for argument in &list.args {
                    if let syn::GenericArgument::Type(ty) = argument {
                        inner.push(ty);
                    }
                }
            }
            let first = || inner.first().map(|ty| values(ty)).unwrap_or_else(default);
            match last.ident.to_string().as_str() {
                "bool" => vec!["true".into(), "false".into()],
                "f64" | "f32" => vec!["0.0".into(), "1.0".into(), "-1.0".into()],
                "u8" | "u16" | "u32" | "u64" | "u128" | "usize" => vec!["0".into(), "1".into()],
                "i8" | "i16" | "i32" | "i64" | "i128" | "isize" => vec!["0".into(), "1".into(), "-1".into()],
                "String" => vec!["String::new()".into(), "\"xyzzy\".into()".into()],
                "Vec" => {
                    let mut all = vec!["vec![]".to_owned()];
                    all.extend(each(first(), &|v| format!("vec![{v}]")));
                    all
                }
                "Option" => {
                    let mut all = vec!["None".to_owned()];
                    all.extend(each(first(), &|v| format!("Some({v})")));
                    all
                }
                "Result" => each(first(), &|v| format!("Ok({v})")),
                "Box" | "Arc" | "Rc" => each(first(), &|v| format!("{}::new({v})", last.ident)),
                _ => default(),
            }
        }
        Type::Tuple(tuple) => {
            let mut all = vec![Vec::new()];
            for ty in &tuple.elems {
                let of = values(ty);
                all = all
                    .into_iter()
                    .flat_map(|a| of.iter().map(move |v| [a.clone(), vec![v.clone()]].concat()))
                    .collect();
            }
            all.truncate(9);
            all.into_iter().map(|v| format!("({}{})", v.join(", "), if v.len() == 1 { "," } else { "" })).collect()
        }
        Type::Array(array) => each(values(&array.elem), &|v| format!("std::array::from_fn(|_| {v})")),
        Type::Reference(reference) => match (&*reference.elem, reference.mutability.is_some()) {
            (_, true) => Vec::new(),
            (Type::Path(path), _) if path.path.is_ident("str") => vec!["\"\"".into(), "\"xyzzy\"".into()],
            (Type::Slice(_), _) => vec!["&[]".into()],
            _ => Vec::new(),
        },
        Type::Paren(inner) => values(&inner.elem),
        Type::Never(_) | Type::ImplTrait(_) | Type::TraitObject(_) => Vec::new(),
        _ => default(),
    }
}

/// What cargo-mutants puts in an operator's place.
fn replacements(op: &BinOp) -> (&'static str, &'static [&'static str]) {
    match op {
        BinOp::Add(_) => ("+", &["-", "*"]),
        BinOp::Sub(_) => ("-", &["+", "/"]),
        BinOp::Mul(_) => ("*", &["+", "/"]),
        BinOp::Div(_) => ("/", &["%", "*"]),
        BinOp::Rem(_) => ("%", &["/", "+"]),
        BinOp::And(_) => ("&&", &["||"]),
        BinOp::Or(_) => ("||", &["&&"]),
        BinOp::BitXor(_) => ("^", &["|", "&"]),
        BinOp::BitAnd(_) => ("&", &["|", "^"]),
        BinOp::BitOr(_) => ("|", &["&", "^"]),
        BinOp::Shl(_) => ("<<", &[">>"]),
        BinOp::Shr(_) => (">>", &["<<"]),
        BinOp::Eq(_) => ("==", &["!="]),
        BinOp::Ne(_) => ("!=", &["=="]),
        BinOp::Lt(_) => ("<", &["==", ">", "<="]),
        BinOp::Gt(_) => (">", &["==", "<", ">="]),
        BinOp::Le(_) => ("<=", &[">"]),
        BinOp::Ge(_) => (">=", &["<"]),
        BinOp::AddAssign(_) => ("+=", &["-=", "*="]),
        BinOp::SubAssign(_) => ("-=", &["+=", "/="]),
        BinOp::MulAssign(_) => ("*=", &["+=", "/="]),
        BinOp::DivAssign(_) => ("/=", &["%=", "*="]),
        BinOp::RemAssign(_) => ("%=", &["/=", "+="]),
        BinOp::BitXorAssign(_) => ("^=", &["|=", "&="]),
        BinOp::BitAndAssign(_) => ("&=", &["|=", "^="]),
        BinOp::BitOrAssign(_) => ("|=", &["&=", "^="]),
        BinOp::ShlAssign(_) => ("<<=", &[">>="]),
        BinOp::ShrAssign(_) => (">>=", &["<<="]),
        _ => ("", &[]),
    }
}

/// Whether a chain of conditions binds names, which a `match` would hide.
fn binds(expr: &Expr) -> bool {
    match expr {
        Expr::Let(_) => true,
        Expr::Binary(b) => matches!(b.op, BinOp::And(_) | BinOp::Or(_)) && (binds(&b.left) || binds(&b.right)),
        _ => false,
    }
}

impl<'ast> Visit<'ast> for Finder<'_> {
    fn visit_attribute(&mut self, _: &'ast syn::Attribute) {}
    fn visit_pat(&mut self, _: &'ast syn::Pat) {}
    fn visit_type(&mut self, _: &'ast Type) {}
    fn visit_generic_argument(&mut self, _: &'ast syn::GenericArgument) {}
    fn visit_generics(&mut self, _: &'ast syn::Generics) {}
    fn visit_item_const(&mut self, _: &'ast syn::ItemConst) {}
    fn visit_item_static(&mut self, _: &'ast syn::ItemStatic) {}
    fn visit_item_enum(&mut self, _: &'ast syn::ItemEnum) {}
    fn visit_item_macro(&mut self, _: &'ast syn::ItemMacro) {}
    fn visit_impl_item_const(&mut self, _: &'ast syn::ImplItemConst) {}
    fn visit_trait_item_const(&mut self, _: &'ast syn::TraitItemConst) {}
    fn visit_expr_const(&mut self, _: &'ast syn::ExprConst) {}
    fn visit_expr_repeat(&mut self, node: &'ast syn::ExprRepeat) {
        self.visit_expr(&node.expr);
    }

    fn visit_macro(&mut self, node: &'ast syn::Macro) {
        // Of macros only lists are looked into; conditions of assertions are not.
        if node.path.is_ident("vec") {
            let list = Punctuated::<Expr, Token![,]>::parse_terminated;
            if let Ok(items) = node.parse_body_with(list) {
                for item in &items {
                    Visit::visit_expr(self, item);
                }
            }
        }
    }

    fn visit_item_mod(&mut self, node: &'ast syn::ItemMod) {
        if !skipped(&node.attrs) {
            visit::visit_item_mod(self, node);
        }
    }

    fn visit_item_impl(&mut self, node: &'ast syn::ItemImpl) {
        if skipped(&node.attrs) {
            return;
        }
        let mut name = self.source(&node.self_ty);
        if let Some((_, path, _)) = &node.trait_ {
            name = format!("<{} for {name}>", self.source(path));
        }
        self.names.push(name);
        visit::visit_item_impl(self, node);
        self.names.pop();
    }

    fn visit_item_trait(&mut self, node: &'ast syn::ItemTrait) {
        self.names.push(node.ident.to_string());
        visit::visit_item_trait(self, node);
        self.names.pop();
    }

    fn visit_item_fn(&mut self, node: &'ast syn::ItemFn) {
        self.function(&node.attrs, &node.sig, &node.block, |v| visit::visit_item_fn(v, node));
    }

    fn visit_impl_item_fn(&mut self, node: &'ast syn::ImplItemFn) {
        self.function(&node.attrs, &node.sig, &node.block, |v| visit::visit_impl_item_fn(v, node));
    }

    fn visit_trait_item_fn(&mut self, node: &'ast syn::TraitItemFn) {
        if let Some(block) = &node.default {
            self.function(&node.attrs, &node.sig, block, |v| visit::visit_trait_item_fn(v, node));
        }
    }

    fn visit_expr_match(&mut self, node: &'ast syn::ExprMatch) {
        self.visit_expr(&node.expr);
        let catches = node.arms.iter().any(|arm| matches!(arm.pat, syn::Pat::Wild(_)) && arm.guard.is_none());
        let outer = std::mem::replace(&mut self.deletable, catches);
        for arm in &node.arms {
            self.deletable = catches;
            self.visit_arm(arm);
        }
        self.deletable = outer;
    }

    fn visit_arm(&mut self, node: &'ast syn::Arm) {
        let deletable = self.deletable && !matches!(node.pat, syn::Pat::Wild(_));
        let place = node.pat.span().start();
        let named = format!("match arm {}", self.source(&node.pat));
        match &node.guard {
            Some((_, guard)) if !binds(guard) => {
                let mut to: Vec<(String, String)> =
                    ["true", "false"].iter().map(|v| ((*v).into(), (*v).into())).collect();
                if deletable {
                    to.push(("deleted".into(), String::new()));
                }
                let original = format!("match guard {}", self.source(&**guard));
                let kind = Kind::Guard { arm: deletable };
                let place = guard.span().start();
                self.site(kind, guard.span().byte_range(), place, &original, &to, |v| v.visit_expr(guard));
            }
            Some((_, guard)) => self.visit_expr(guard),
            None if deletable => {
                let at = node.pat.span().byte_range().end;
                self.site(Kind::Arm, at..at, place, &named, &[("deleted".into(), String::new())], |_| ());
            }
            None => {}
        }
        self.visit_expr(&node.body);
    }

    fn visit_expr_binary(&mut self, node: &'ast syn::ExprBinary) {
        let (op, to) = replacements(&node.op);
        let (left, right) = (node.left.span().byte_range(), node.right.span().byte_range());
        let op: String = op.into();
        let kind = match &node.op {
            _ if to.is_empty() => return visit::visit_expr_binary(self, node),
            BinOp::And(_) | BinOp::Or(_) => {
                if binds(&node.left) || binds(&node.right) {
                    return visit::visit_expr_binary(self, node);
                }
                Kind::Short { left, or: op == "||", right }
            }
            BinOp::Eq(_) | BinOp::Ne(_) | BinOp::Lt(_) | BinOp::Gt(_) | BinOp::Le(_) | BinOp::Ge(_) => {
                Kind::Compare { left, op: op.clone(), right }
            }
            _ if op.ends_with('=') => Kind::Assign { left, op: op.clone(), right },
            _ => Kind::Value { left, op: op.clone(), right },
        };
        let to: Vec<(String, String)> = to.iter().map(|t| ((*t).into(), String::new())).collect();
        self.site(kind, node.span().byte_range(), node.op.span().start(), &op, &to, |v| {
            visit::visit_expr_binary(v, node);
        });
    }

    fn visit_expr_unary(&mut self, node: &'ast syn::ExprUnary) {
        let op = match node.op {
            UnOp::Neg(_) => "-",
            UnOp::Not(_) => "!",
            _ => return visit::visit_expr_unary(self, node),
        };
        let kind = Kind::Unary { op: op.into(), operand: node.expr.span().byte_range() };
        let to = [("deleted".into(), String::new())];
        self.site(kind, node.span().byte_range(), node.op.span().start(), op, &to, |v| {
            visit::visit_expr_unary(v, node)
        });
    }
}
