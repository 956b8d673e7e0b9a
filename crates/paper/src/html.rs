//! Text, rich text and files inside a page. Everything that comes from data passes through here.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, utf8_percent_encode};
use twofold_render::markup::{self, Token};

/// Text that is safe in HTML and XML, inside elements and inside quoted attributes. Control
/// characters that XML does not allow become a replacement character.
pub fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            '\n' | '\t' | '\r' => out.push(c),
            c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
    out
}

/// The renderer's rich text (`*x*`, `_{+}`, `10^{-5}`) as HTML; text whose markup is not balanced
/// is shown as it stands.
pub fn rich(text: &str) -> String {
    try_rich(text).unwrap_or_else(|| escape(text))
}

fn try_rich(text: &str) -> Option<String> {
    let mut out = String::new();
    let mut italic = false;
    // Elements that an end closes; an italic passage may not straddle them.
    let mut open: Vec<(&str, bool)> = Vec::new();
    for token in markup::parse(text).ok()? {
        match token {
            Token::Sign(c) => out.push_str(&escape(&c.to_string())),
            Token::Minus => out.push('−'),
            Token::Italic => {
                out.push_str(if italic { "</i>" } else { "<i>" });
                italic = !italic;
            }
            Token::Raise | Token::Lower | Token::Group => {
                let element = match token {
                    Token::Raise => "sup",
                    Token::Lower => "sub",
                    _ => "span",
                };
                out.push_str(&format!("<{element}>"));
                open.push((element, italic));
            }
            Token::End => {
                let (element, was_italic) = open.pop()?;
                if was_italic != italic {
                    return None;
                }
                out.push_str(&format!("</{element}>"));
            }
        }
    }
    Some(out)
}

/// A file as a data address.
pub fn data_address(media_type: &str, bytes: &[u8]) -> String {
    format!("data:{media_type};base64,{}", base64(bytes))
}

/// RFC 4648, section 4.
pub fn base64(bytes: &[u8]) -> String {
    STANDARD.encode(bytes)
}

/// Characters that a link's target keeps as they are: RFC 3986's unreserved ones, and slashes.
const KEPT: &AsciiSet =
    &NON_ALPHANUMERIC.remove(b'-').remove(b'.').remove(b'_').remove(b'~').remove(b'/');

/// A link's target from a path inside the folder.
pub fn address(path: &str) -> String {
    utf8_percent_encode(path, KEPT).to_string()
}

/// An identifier for an element: letters, digits, hyphens.
pub fn identifier(text: &str) -> String {
    text.bytes()
        .map(|b| {
            if b.is_ascii_alphanumeric() {
                char::from(b).to_string()
            } else {
                format!("-{b:x}-").replace("-2d-", "-")
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rich_text() {
        assert_eq!(
            rich("*α* = 10^{-5}, *v*_{+} < 1"),
            "<i>α</i> = 10<sup>−5</sup>, <i>v</i><sub>+</sub> &lt; 1"
        );
        assert_eq!(rich("x^2"), "x<sup>2</sup>");
        assert_eq!(rich("from -1.2 to 2-10, {a}"), "from −1.2 to 2-10, <span>a</span>");
        for broken in ["*a", "a}", "^{b", "{", "^", "*a_{b*}"] {
            assert_eq!(rich(broken), broken);
        }
        assert_eq!(rich("*<b>"), "*&lt;b&gt;");
        assert_eq!(rich("\\*<"), "*&lt;");
    }

    #[test]
    fn nothing_breaks_out() {
        assert_eq!(escape("<script>\"'&\u{0}"), "&lt;script&gt;&quot;&#39;&amp;\u{fffd}");
        assert_eq!(address("a/b c\"<.png"), "a/b%20c%22%3C.png");
        assert_eq!(identifier("fig7-first"), "fig7-first");
        assert_ne!(identifier("a b"), identifier("a.b"));
    }
}
