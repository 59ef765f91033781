//! From text to tokens: words, strings, numbers and brackets, with comments left out and
//! `$name` replaced.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::source::{Sources, Span};
use crate::error::SceneError;

/// What a token is.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum TokenKind {
    /// A directive's name, or `true` and `false`.
    Word(String),
    /// The text between quotes.
    Text(String),
    /// A number, finite.
    Number(f64),
    /// `[`
    Open,
    /// `]`
    Close,
}

impl TokenKind {
    /// How messages name the token.
    pub(crate) fn describe(&self) -> String {
        match self {
            TokenKind::Word(word) => format!("`{word}`"),
            TokenKind::Text(text) => format!("\"{}\"", shortened(text)),
            TokenKind::Number(number) => format!("the number {number}"),
            TokenKind::Open => "`[`".to_owned(),
            TokenKind::Close => "`]`".to_owned(),
        }
    }
}

/// A token and its place.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Token {
    pub(crate) kind: TokenKind,
    pub(crate) span: Span,
}

/// Text short enough for a message, which a terminal shows and does not obey.
pub(crate) fn shortened(text: &str) -> String {
    shortened_to(text, 40)
}

/// The same, with so many characters at most.
pub(crate) fn shortened_to(text: &str, longest: usize) -> String {
    let mut short = String::new();
    for c in text.chars().take(longest) {
        match c.is_control() {
            true => short.extend(c.escape_default()),
            false => short.push(c),
        }
    }
    if text.chars().nth(longest).is_some() {
        short.push('…');
    }
    short
}

/// Reads the tokens of one file.
#[derive(Debug)]
pub(crate) struct Lexer {
    file: u32,
    text: Arc<[u8]>,
    at: usize,
    /// Tokens of a `$name`'s value that are still to come, last first.
    pending: Vec<Token>,
}

fn ends_word(byte: u8) -> bool {
    byte.is_ascii_whitespace() || matches!(byte, b'"' | b'[' | b']' | b'#')
}

impl Lexer {
    pub(crate) fn new(sources: &Sources, file: u32) -> Self {
        let text = Arc::clone(&sources.get(file).text);
        // A byte order mark is no token.
        let at = if text.starts_with(b"\xef\xbb\xbf") {
            3
        } else {
            0
        };
        Lexer {
            file,
            text,
            at,
            pending: Vec::new(),
        }
    }

    pub(crate) fn file(&self) -> u32 {
        self.file
    }

    /// Makes `token` the next one.
    pub(crate) fn put_back(&mut self, token: Token) {
        self.pending.push(token);
    }

    /// The next token; `None` at the end of the file.
    pub(crate) fn next(
        &mut self,
        sources: &Sources,
        defines: &BTreeMap<String, String>,
    ) -> Result<Option<Token>, SceneError> {
        loop {
            if let Some(token) = self.pending.pop() {
                return Ok(Some(token));
            }
            self.skip_blanks();
            let span = Span {
                file: self.file,
                offset: self.at,
            };
            let Some(&first) = self.text.get(self.at) else {
                return Ok(None);
            };
            let kind = match first {
                b'[' | b']' => {
                    self.at += 1;
                    if first == b'[' {
                        TokenKind::Open
                    } else {
                        TokenKind::Close
                    }
                }
                b'"' => TokenKind::Text(self.text_token(sources, defines, span)?),
                _ => {
                    let end = self.text[self.at..]
                        .iter()
                        .position(|&b| ends_word(b))
                        .map_or(self.text.len(), |i| self.at + i);
                    let word = &self.text[self.at..end];
                    self.at = end;
                    if word.contains(&b'$') {
                        let text = String::from_utf8_lossy(word).into_owned();
                        let text = substituted(&text, sources, defines, span)?;
                        // The value may hold several tokens; they all have the place of the name.
                        let mut inner = Lexer {
                            file: self.file,
                            text: text.into_bytes().into(),
                            at: 0,
                            pending: Vec::new(),
                        };
                        let nothing = BTreeMap::new();
                        while let Some(token) = inner
                            .next(sources, &nothing)
                            .map_err(|error| sources.error(span, error.message))?
                        {
                            self.pending.push(Token { span, ..token });
                        }
                        self.pending.reverse();
                        continue;
                    }
                    word_or_number(word, sources, span)?
                }
            };
            return Ok(Some(Token { kind, span }));
        }
    }

    fn skip_blanks(&mut self) {
        while let Some(&byte) = self.text.get(self.at) {
            if byte == b'#' {
                let rest = &self.text[self.at..];
                self.at += rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
            } else if byte.is_ascii_whitespace() {
                self.at += 1;
            } else {
                break;
            }
        }
    }

    /// The text of a string that starts at `self.at`, with its escapes resolved.
    fn text_token(
        &mut self,
        sources: &Sources,
        defines: &BTreeMap<String, String>,
        span: Span,
    ) -> Result<String, SceneError> {
        let mut bytes = Vec::new();
        let mut at = self.at + 1;
        loop {
            match self.text.get(at) {
                None | Some(b'\n') => {
                    return Err(sources.error(
                        span,
                        "this string has no closing quote on its line; write \"text\"",
                    ));
                }
                Some(b'"') => break,
                Some(b'\\') => {
                    at += 1;
                    match self.text.get(at) {
                        Some(b'n') => bytes.push(b'\n'),
                        Some(b't') => bytes.push(b'\t'),
                        Some(&byte @ (b'"' | b'\\')) => bytes.push(byte),
                        // As in a Windows path: the backslash is meant.
                        Some(&byte) if byte != b'\n' => bytes.extend([b'\\', byte]),
                        _ => continue,
                    }
                }
                Some(&byte) => bytes.push(byte),
            }
            at += 1;
        }
        self.at = at + 1;
        let text = String::from_utf8_lossy(&bytes).into_owned();
        if text.contains('$') {
            substituted(&text, sources, defines, span)
        } else {
            Ok(text)
        }
    }
}

/// `text` with every `$name` and `${name}` replaced by its value.
fn substituted(
    text: &str,
    sources: &Sources,
    defines: &BTreeMap<String, String>,
    span: Span,
) -> Result<String, SceneError> {
    let mut result = String::new();
    let mut rest = text;
    while let Some(dollar) = rest.find('$') {
        result.push_str(&rest[..dollar]);
        let after = &rest[dollar + 1..];
        let (inside, braced) = match after.strip_prefix('{') {
            Some(inside) => (inside, true),
            None => (after, false),
        };
        let length = inside
            .find(|c: char| !(c.is_ascii_alphanumeric() || c == '_'))
            .unwrap_or(inside.len());
        let (name, tail) = inside.split_at(length);
        let tail = if braced {
            tail.strip_prefix('}')
        } else {
            Some(tail)
        };
        let (Some(tail), false) = (tail, name.is_empty()) else {
            return Err(sources.error(
                span,
                format!(
                    "`{}` is not the name of a definition; write $name or ${{name}}",
                    shortened(text)
                ),
            ));
        };
        let Some(value) = defines.get(name) else {
            return Err(sources.error(
                span,
                format!(
                    "`${name}` is not defined; this file is a template: give its value with \
                     --define {name}=VALUE"
                ),
            ));
        };
        result.push_str(value);
        rest = tail;
    }
    result.push_str(rest);
    Ok(result)
}

fn word_or_number(word: &[u8], sources: &Sources, span: Span) -> Result<TokenKind, SceneError> {
    let text = std::str::from_utf8(word).unwrap_or_default();
    if word[0].is_ascii_alphabetic() && text.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_')
    {
        let lower = text.to_ascii_lowercase();
        if !matches!(lower.as_str(), "nan" | "inf" | "infinity") {
            return Ok(TokenKind::Word(text.to_owned()));
        }
    }
    match text.parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(TokenKind::Number(number)),
        Ok(_) => Err(sources.error(
            span,
            format!("{text} is not a number that can be used; numbers are finite"),
        )),
        Err(_) => Err(sources.error(
            span,
            format!(
                "`{}` is neither a directive, a number, a bracket nor a \"text\" in quotes",
                shortened(&String::from_utf8_lossy(word))
            ),
        )),
    }
}
