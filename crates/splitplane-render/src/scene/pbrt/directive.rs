//! From tokens to directives, through all included files.

mod list;

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::io::Read;
use std::path::{Path, PathBuf};

use super::lexer::{Lexer, Token, TokenKind, shortened};
use super::params::Params;
use super::source::{Sources, Span};
use super::v4;
use crate::error::SceneError;

/// What follows a directive's name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Arguments {
    None,
    Numbers(usize),
    /// `"name"`
    Name,
    /// `All`, `StartTime`, `EndTime`
    Word,
    /// `"name"` or two.
    OneOrTwoNames,
    /// `"name" "type name" [values] ...`
    List,
    /// `"name" "type" "class" "type name" [values] ...`
    TextureList,
}

macro_rules! directives {
    ($($name:ident $arguments:expr;)*) => {
        /// The directives of pbrt-v3 and v4, Include, Import and Option apart, which the parser sees
        /// to itself.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub(crate) enum Word { $($name),* }

        impl Word {
            fn named(name: &str) -> Option<(Word, Arguments)> {
                match name {
                    $(stringify!($name) => Some((Word::$name, $arguments)),)*
                    _ => None,
                }
            }

            /// The name in the file.
            pub(crate) fn name(self) -> &'static str {
                match self { $(Word::$name => stringify!($name)),* }
            }
        }
    };
}

directives! {
    Attribute Arguments::List;
    ColorSpace Arguments::Name;
    Accelerator Arguments::List;
    ActiveTransform Arguments::Word;
    AreaLightSource Arguments::List;
    AttributeBegin Arguments::None;
    AttributeEnd Arguments::None;
    Camera Arguments::List;
    ConcatTransform Arguments::Numbers(16);
    CoordSysTransform Arguments::Name;
    CoordinateSystem Arguments::Name;
    Film Arguments::List;
    Identity Arguments::None;
    Integrator Arguments::List;
    LightSource Arguments::List;
    LookAt Arguments::Numbers(9);
    MakeNamedMaterial Arguments::List;
    MakeNamedMedium Arguments::List;
    Material Arguments::List;
    MediumInterface Arguments::OneOrTwoNames;
    NamedMaterial Arguments::Name;
    ObjectBegin Arguments::Name;
    ObjectEnd Arguments::None;
    ObjectInstance Arguments::Name;
    PixelFilter Arguments::List;
    ReverseOrientation Arguments::None;
    Rotate Arguments::Numbers(4);
    Sampler Arguments::List;
    Scale Arguments::Numbers(3);
    Shape Arguments::List;
    Texture Arguments::TextureList;
    Transform Arguments::Numbers(16);
    TransformBegin Arguments::None;
    TransformEnd Arguments::None;
    TransformTimes Arguments::Numbers(2);
    Translate Arguments::Numbers(3);
    WorldBegin Arguments::None;
    WorldEnd Arguments::None;
}

/// A directive with its arguments.
#[derive(Clone, Debug)]
pub(crate) struct Directive {
    pub(crate) word: Word,
    pub(crate) span: Span,
    pub(crate) numbers: Vec<f64>,
    pub(crate) names: Vec<String>,
    pub(crate) params: Params,
}

impl Directive {
    /// The first name; empty where the directive has none.
    pub(crate) fn name(&self) -> &str {
        self.names.first().map_or("", String::as_str)
    }
}

/// The text of a file, as it is or compressed by gzip.
fn read(path: &Path) -> Result<Vec<u8>, String> {
    let bytes = std::fs::read(path).map_err(|error| error.to_string())?;
    if !bytes.starts_with(&[0x1f, 0x8b]) {
        return Ok(bytes);
    }
    let mut plain = Vec::new();
    flate2::read::MultiGzDecoder::new(bytes.as_slice())
        .read_to_end(&mut plain)
        .map_err(|error| format!("it cannot be decompressed: {error}"))?;
    Ok(plain)
}

/// More files inside each other than any scene has.
const DEEPEST_INCLUDE: usize = 64;

/// More files, each counted as often as it is included, than any scene has.
const MOST_INCLUDES: u32 = 20_000;

/// Reads directives.
#[derive(Debug)]
pub(crate) struct Parser<'a> {
    pub(crate) sources: Sources,
    defines: &'a BTreeMap<String, String>,
    search: &'a [PathBuf],
    /// The files that are being read, the innermost last.
    open: Vec<Lexer>,
    peeked: Option<Token>,
    includes: u32,
    /// The scene is in pbrt-v4's words.
    pub(crate) is_v4: bool,
    /// The file is a part of a scene: it has shapes and no WorldBegin.
    pub(crate) is_part: bool,
    /// The main file, and all that were found.
    pub(crate) found: RefCell<BTreeSet<PathBuf>>,
    /// Files that were to be included and are not there, since the last directive.
    pub(crate) missing: Vec<(String, Span)>,
}

impl<'a> Parser<'a> {
    /// A parser of the scene file at `path`.
    pub(crate) fn new(
        path: &Path,
        defines: &'a BTreeMap<String, String>,
        search: &'a [PathBuf],
    ) -> Result<Self, SceneError> {
        let text = read(path).map_err(|reason| {
            SceneError::file(
                path.display().to_string(),
                format!("cannot be read: {reason}"),
            )
        })?;
        let is_v4 = v4::is_v4(&text);
        let has = |wanted: &[u8]| {
            text.split(u8::is_ascii_whitespace)
                .any(|word| word == wanted)
        };
        let is_part = has(b"Shape") && !has(b"WorldBegin");
        let mut sources = Sources::default();
        let file = sources.add(path, text.into());
        let lexer = Lexer::new(&sources, file);
        Ok(Parser {
            sources,
            defines,
            search,
            open: vec![lexer],
            peeked: None,
            includes: 0,
            is_v4,
            is_part,
            found: RefCell::new(BTreeSet::from([path.to_owned()])),
            missing: Vec::new(),
        })
    }

    /// The next directive; `None` at the end of the scene.
    pub(crate) fn next(&mut self) -> Result<Option<Directive>, SceneError> {
        loop {
            let Some(token) = self.token()? else {
                self.open.pop();
                if self.open.is_empty() {
                    return Ok(None);
                }
                continue;
            };
            let TokenKind::Word(word) = &token.kind else {
                return Err(self.error(
                    token.span,
                    format!(
                        "{} stands where a directive is expected, such as Shape or AttributeBegin",
                        token.kind.describe()
                    ),
                ));
            };
            if word == "Option" && self.is_v4 {
                self.params()?;
                continue;
            }
            if word == "Include" || word == "Import" && self.is_v4 {
                let (name, span) = self.text("a file's name in quotes")?;
                self.include(&name, span)?;
                continue;
            }
            let known = Word::named(word).filter(|(word, _)| {
                self.is_v4 || !matches!(word, Word::Attribute | Word::ColorSpace)
            });
            let Some((word, arguments)) = known else {
                return Err(self.error(
                    token.span,
                    format!(
                        "`{}` is not a directive of pbrt-v{}",
                        shortened(word),
                        if self.is_v4 { 4 } else { 3 }
                    ),
                ));
            };
            let directive = self.directive(word, arguments, token.span)?;
            return Ok(Some(if self.is_v4 {
                v4::translated(directive)
            } else {
                directive
            }));
        }
    }

    fn directive(
        &mut self,
        word: Word,
        arguments: Arguments,
        span: Span,
    ) -> Result<Directive, SceneError> {
        let mut directive = Directive {
            word,
            span,
            numbers: Vec::new(),
            names: Vec::new(),
            params: Params::default(),
        };
        match arguments {
            Arguments::None => {}
            Arguments::Numbers(count) => directive.numbers = self.numbers(word, count, span)?,
            Arguments::Name => directive.names.push(self.text("a name in quotes")?.0),
            Arguments::Word => match self.token()? {
                Some(Token {
                    kind: TokenKind::Word(name),
                    ..
                }) => directive.names.push(name),
                _ => {
                    return Err(self.error(
                        span,
                        format!("{} takes All, StartTime or EndTime", word.name()),
                    ));
                }
            },
            Arguments::OneOrTwoNames => {
                directive.names.push(self.text("a name in quotes")?.0);
                if let Some(Token {
                    kind: TokenKind::Text(_),
                    ..
                }) = self.peek()?
                {
                    directive.names.push(self.text("a name in quotes")?.0);
                }
            }
            Arguments::List => {
                directive.names.push(self.text("a name in quotes")?.0);
                directive.params = self.params()?;
            }
            Arguments::TextureList => {
                for what in [
                    "the texture's name",
                    "\"float\" or \"spectrum\"",
                    "the texture's class",
                ] {
                    directive.names.push(self.text(what)?.0);
                }
                directive.params = self.params()?;
            }
        }
        Ok(directive)
    }

    pub(crate) fn error(&self, span: Span, message: impl Into<String>) -> SceneError {
        self.sources.error(span, message)
    }

    fn token(&mut self) -> Result<Option<Token>, SceneError> {
        if let Some(token) = self.peeked.take() {
            return Ok(Some(token));
        }
        match self.open.last_mut() {
            Some(lexer) => lexer.next(&self.sources, self.defines),
            None => Ok(None),
        }
    }

    fn peek(&mut self) -> Result<Option<&Token>, SceneError> {
        if self.peeked.is_none() {
            self.peeked = self.token()?;
        }
        Ok(self.peeked.as_ref())
    }

    /// Where the file that is being read ends.
    fn end(&self) -> Span {
        let file = self.open.last().map_or(0, Lexer::file);
        Span {
            file,
            offset: self.sources.get(file).text.len(),
        }
    }

    fn text(&mut self, expected: &str) -> Result<(String, Span), SceneError> {
        match self.token()? {
            Some(Token {
                kind: TokenKind::Text(text),
                span,
            }) => Ok((text, span)),
            Some(token) => Err(self.error(
                token.span,
                format!(
                    "{} stands where {expected} is expected",
                    token.kind.describe()
                ),
            )),
            None => Err(self.error(
                self.end(),
                format!("the file ends where {expected} is expected"),
            )),
        }
    }

    /// Exactly `count` numbers, in brackets or not.
    fn numbers(&mut self, word: Word, count: usize, span: Span) -> Result<Vec<f64>, SceneError> {
        let mut numbers = Vec::with_capacity(count);
        let bracket = matches!(
            self.peek()?,
            Some(Token {
                kind: TokenKind::Open,
                ..
            })
        );
        if bracket {
            self.token()?;
        }
        while numbers.len() < count {
            match self.token()? {
                Some(Token {
                    kind: TokenKind::Number(number),
                    ..
                }) => numbers.push(number),
                other => {
                    let span = other.map_or(span, |token| token.span);
                    return Err(self.error(
                        span,
                        format!(
                            "{} has {} numbers; it takes {count}",
                            word.name(),
                            numbers.len()
                        ),
                    ));
                }
            }
        }
        if bracket {
            match self.token()? {
                Some(Token {
                    kind: TokenKind::Close,
                    ..
                }) => {}
                other => {
                    let span = other.map_or(span, |token| token.span);
                    return Err(self.error(
                        span,
                        format!(
                            "`]` is expected after the {count} numbers of {}",
                            word.name()
                        ),
                    ));
                }
            }
        }
        Ok(numbers)
    }

    /// Where a file that `span` names is: an absolute path, or relative to the folder of the file
    /// that names it, to that of the main file, or to a folder of the search path.
    pub(crate) fn find(&self, name: &str, span: Span) -> Option<PathBuf> {
        let name = name.replace('\\', "/");
        let folders = [span.file, 0]
            .into_iter()
            .map(|file| {
                self.sources
                    .get(file)
                    .path
                    .parent()
                    .unwrap_or(Path::new(""))
            })
            .chain(self.search.iter().map(PathBuf::as_path));
        let path = folders
            .map(|folder| folder.join(&name))
            .find(|path| path.is_file())?;
        self.found.borrow_mut().insert(path.clone());
        Some(path)
    }

    fn include(&mut self, name: &str, span: Span) -> Result<(), SceneError> {
        let Some(path) = self.find(name, span) else {
            self.missing.push((name.to_owned(), span));
            return Ok(());
        };
        let same = |lexer: &Lexer| {
            let open = &self.sources.get(lexer.file()).path;
            open == &path
                || matches!((open.canonicalize(), path.canonicalize()), (Ok(a), Ok(b)) if a == b)
        };
        if self.open.iter().any(same) {
            return Err(self.error(
                span,
                format!("\"{name}\" includes itself, directly or through other files"),
            ));
        }
        self.includes += 1;
        if self.includes > MOST_INCLUDES {
            return Err(self.error(
                span,
                format!("the scene includes files more than {MOST_INCLUDES} times"),
            ));
        }
        if self.open.len() >= DEEPEST_INCLUDE {
            return Err(self.error(
                span,
                format!(
                    "files are included {DEEPEST_INCLUDE} deep, which is as deep as they may be"
                ),
            ));
        }
        let text = read(&path)
            .map_err(|reason| self.error(span, format!("\"{name}\" cannot be read: {reason}")))?;
        let file = self.sources.add(&path, text.into());
        self.open.push(Lexer::new(&self.sources, file));
        Ok(())
    }
}
