//! The parameter lists of directives.

use super::Parser;
use crate::error::SceneError;
use crate::scene::pbrt::lexer::{Token, TokenKind, shortened};
use crate::scene::pbrt::params::{Param, Params, Type, Values};
use crate::scene::pbrt::source::Span;

impl Parser<'_> {
    pub(super) fn params(&mut self) -> Result<Params, SceneError> {
        let mut params = Params::default();
        while let Some(Token {
            kind: TokenKind::Text(_),
            ..
        }) = self.peek()?
        {
            let (declaration, span) = self.text("a parameter")?;
            let mut words = declaration.split_whitespace();
            let (Some(ty), Some(name), None) = (words.next(), words.next(), words.next()) else {
                return Err(self.error(
                    span,
                    format!(
                        "\"{}\" does not declare a parameter; write \"type name\" with a type of {}",
                        shortened(&declaration),
                        Type::names()
                    ),
                ));
            };
            let Some(ty) = Type::named(ty) else {
                return Err(self.error(
                    span,
                    format!(
                        "\"{}\" is not a type; types are {}",
                        shortened(ty),
                        Type::names()
                    ),
                ));
            };
            let values = self.values(ty, name, span)?;
            if params.has(name) {
                return Err(self.error(span, format!("\"{name}\" is given twice; once is enough")));
            }
            params
                .list
                .push(Param::new(name.to_owned(), ty, values, span));
        }
        Ok(params)
    }

    /// The values of a parameter: one, or any number in brackets.
    fn values(&mut self, ty: Type, name: &str, span: Span) -> Result<Values, SceneError> {
        // A spectrum is given as numbers or as the names of files.
        let texts = matches!(ty, Type::Text | Type::Texture)
            || ty == Type::Spectrum && self.next_value_is_text()?;
        let mut values = match ty {
            Type::Bool => Values::Bools(Vec::new()),
            Type::Integer => Values::Integers(Vec::new()),
            _ if texts => Values::Texts(Vec::new()),
            _ => Values::Numbers(Vec::new()),
        };
        let open = match self.peek()? {
            Some(Token {
                kind: TokenKind::Open,
                span,
            }) => Some(*span),
            _ => None,
        };
        if open.is_some() {
            self.token()?;
        }
        let mut count = 0_usize;
        loop {
            let token = self.token()?;
            match (token, open) {
                (
                    Some(Token {
                        kind: TokenKind::Close,
                        ..
                    }),
                    Some(_),
                ) => break,
                (Some(Token { kind, span }), _)
                    if !matches!(kind, TokenKind::Open | TokenKind::Close) =>
                {
                    self.push(&mut values, ty, name, kind, span)?;
                    count += 1;
                    if open.is_none() {
                        break;
                    }
                }
                (None, Some(open)) => {
                    return Err(self.error(open, "this `[` has no `]`"));
                }
                (Some(token), _) => {
                    return Err(self.error(
                        token.span,
                        format!(
                            "{} stands where a value of \"{name}\" is expected",
                            token.kind.describe()
                        ),
                    ));
                }
                (None, None) => {
                    return Err(self.error(span, format!("\"{name}\" has no value")));
                }
            }
        }
        if count == 0 {
            return Err(self.error(span, format!("\"{name}\" has no values")));
        }
        let arity = match ty {
            _ if texts => 1,
            Type::Blackbody if self.is_v4 => 1,
            ty => ty.arity(),
        };
        if !count.is_multiple_of(arity) {
            return Err(self.error(
                span,
                format!(
                    "\"{} {name}\" has {count} numbers; they come in groups of {arity}",
                    ty.name()
                ),
            ));
        }
        Ok(values)
    }

    /// Whether the next value is in quotes, behind a bracket or not.
    fn next_value_is_text(&mut self) -> Result<bool, SceneError> {
        match self.peek()? {
            Some(Token {
                kind: TokenKind::Text(_),
                ..
            }) => Ok(true),
            Some(Token {
                kind: TokenKind::Open,
                ..
            }) => {
                let open = self.token()?;
                let is_text = matches!(
                    self.peek()?,
                    Some(Token {
                        kind: TokenKind::Text(_),
                        ..
                    })
                );
                // Both tokens go back: the lexer keeps the later one.
                if let (Some(later), Some(lexer)) = (self.peeked.take(), self.open.last_mut()) {
                    lexer.put_back(later);
                }
                self.peeked = open;
                Ok(is_text)
            }
            _ => Ok(false),
        }
    }

    fn push(
        &self,
        values: &mut Values,
        ty: Type,
        name: &str,
        kind: TokenKind,
        span: Span,
    ) -> Result<(), SceneError> {
        match (values, kind) {
            (Values::Numbers(list), TokenKind::Number(number)) => {
                if number.abs() > f64::from(f32::MAX) {
                    return Err(self.error(
                        span,
                        format!("{number:e} is too large; numbers are below 3.4e38"),
                    ));
                }
                list.push(number);
            }
            (Values::Integers(list), TokenKind::Number(number)) => {
                if number.fract() != 0.0 || number.abs() > f64::from(i32::MAX) {
                    return Err(self.error(
                        span,
                        format!("{number} is not an integer of 32 bits, which \"{name}\" takes"),
                    ));
                }
                list.push(number as i64);
            }
            (Values::Texts(list), TokenKind::Text(text)) => list.push(text),
            (Values::Bools(list), TokenKind::Text(text) | TokenKind::Word(text)) => {
                match text.as_str() {
                    "true" => list.push(true),
                    "false" => list.push(false),
                    _ => {
                        return Err(self.error(
                            span,
                            format!(
                                "\"{}\" is neither true nor false, which \"{name}\" takes",
                                shortened(&text)
                            ),
                        ));
                    }
                }
            }
            (_, kind) => {
                return Err(self.error(
                    span,
                    format!(
                        "{} stands where a value of \"{} {name}\" is expected",
                        kind.describe(),
                        ty.name()
                    ),
                ));
            }
        }
        Ok(())
    }
}
