//! Parameter lists: `"type name" [values]`.

use std::cell::Cell;

use super::source::{Sources, Span};
use crate::error::SceneError;

/// The types of parameters that pbrt-v3 knows, by what their values are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Type {
    Integer,
    Float,
    Point2,
    Vector2,
    Point3,
    Vector3,
    Normal,
    Rgb,
    Xyz,
    Blackbody,
    Spectrum,
    Bool,
    Text,
    Texture,
}

/// Every spelling of a type.
const TYPES: &[(&str, Type)] = &[
    ("integer", Type::Integer),
    ("float", Type::Float),
    ("point2", Type::Point2),
    ("vector2", Type::Vector2),
    ("point", Type::Point3),
    ("point3", Type::Point3),
    ("vector", Type::Vector3),
    ("vector3", Type::Vector3),
    ("normal", Type::Normal),
    ("normal3", Type::Normal),
    ("rgb", Type::Rgb),
    ("color", Type::Rgb),
    ("xyz", Type::Xyz),
    ("blackbody", Type::Blackbody),
    ("spectrum", Type::Spectrum),
    ("bool", Type::Bool),
    ("string", Type::Text),
    ("texture", Type::Texture),
];

impl Type {
    pub(crate) fn named(name: &str) -> Option<Type> {
        TYPES.iter().find(|(own, _)| *own == name).map(|(_, t)| *t)
    }

    /// All types' names, for messages.
    pub(crate) fn names() -> String {
        TYPES
            .iter()
            .map(|(name, _)| *name)
            .collect::<Vec<_>>()
            .join(", ")
    }

    pub(crate) fn name(self) -> &'static str {
        TYPES
            .iter()
            .find(|(_, t)| *t == self)
            .map_or("", |(name, _)| name)
    }

    /// How many numbers make one value.
    pub(crate) fn arity(self) -> usize {
        match self {
            Type::Point2 | Type::Vector2 | Type::Blackbody => 2,
            Type::Point3 | Type::Vector3 | Type::Normal | Type::Rgb | Type::Xyz => 3,
            _ => 1,
        }
    }
}

/// The values of a parameter.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Values {
    Numbers(Vec<f64>),
    Integers(Vec<i64>),
    Texts(Vec<String>),
    Bools(Vec<bool>),
}

/// One parameter.
#[derive(Clone, Debug)]
pub(crate) struct Param {
    pub(crate) name: String,
    pub(crate) ty: Type,
    pub(crate) values: Values,
    pub(crate) span: Span,
    /// Something asked for it.
    used: Cell<bool>,
}

impl Param {
    pub(crate) fn new(name: String, ty: Type, values: Values, span: Span) -> Self {
        Param {
            name,
            ty,
            values,
            span,
            used: Cell::new(false),
        }
    }

    pub(crate) fn numbers(&self) -> &[f64] {
        match &self.values {
            Values::Numbers(numbers) => numbers,
            _ => &[],
        }
    }
}

/// The parameters of one directive.
#[derive(Clone, Debug, Default)]
pub(crate) struct Params {
    pub(crate) list: Vec<Param>,
}

impl Params {
    /// The parameter of that name, whatever its type.
    pub(crate) fn get(&self, name: &str) -> Option<&Param> {
        let param = self.list.iter().find(|param| param.name == name)?;
        param.used.set(true);
        Some(param)
    }

    /// Whether there is one of that name; does not count as use.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.list.iter().any(|param| param.name == name)
    }

    /// Names that are known and need nothing done.
    pub(crate) fn ignore(&self, names: &[&str]) {
        for name in names {
            self.get(name);
        }
    }

    /// All are known to be of no use: the directive is replaced by another.
    pub(crate) fn ignore_all(&self) {
        self.list.iter().for_each(|param| param.used.set(true));
    }

    /// Parameters that nothing asked for.
    pub(crate) fn unused(&self) -> impl Iterator<Item = &Param> {
        self.list.iter().filter(|param| !param.used.get())
    }

    fn typed(
        &self,
        sources: &Sources,
        name: &str,
        types: &[Type],
    ) -> Result<Option<&Param>, SceneError> {
        let Some(param) = self.get(name) else {
            return Ok(None);
        };
        if types.contains(&param.ty) {
            return Ok(Some(param));
        }
        let accepted: Vec<_> = types
            .iter()
            .map(|t| format!("\"{} {name}\"", t.name()))
            .collect();
        Err(sources.error(
            param.span,
            format!(
                "\"{name}\" is given as \"{}\"; accepted is {}",
                param.ty.name(),
                accepted.join(" or ")
            ),
        ))
    }

    fn one<'a, T>(
        sources: &Sources,
        param: &'a Param,
        values: &'a [T],
    ) -> Result<&'a T, SceneError> {
        match values {
            [value] => Ok(value),
            _ => Err(sources.error(
                param.span,
                format!(
                    "\"{}\" has {} values; it takes one",
                    param.name,
                    values.len()
                ),
            )),
        }
    }

    pub(crate) fn float(&self, s: &Sources, name: &str) -> Result<Option<f32>, SceneError> {
        self.typed(s, name, &[Type::Float])?
            .map(|param| Ok(*Self::one(s, param, param.numbers())? as f32))
            .transpose()
    }

    pub(crate) fn integer(&self, s: &Sources, name: &str) -> Result<Option<i64>, SceneError> {
        let Some(param) = self.typed(s, name, &[Type::Integer])? else {
            return Ok(None);
        };
        let Values::Integers(values) = &param.values else {
            return Ok(None);
        };
        Self::one(s, param, values).copied().map(Some)
    }

    /// An integer in a range.
    pub(crate) fn integer_in(
        &self,
        s: &Sources,
        name: &str,
        range: std::ops::RangeInclusive<u32>,
    ) -> Result<Option<u32>, SceneError> {
        let Some(value) = self.integer(s, name)? else {
            return Ok(None);
        };
        match u32::try_from(value)
            .ok()
            .filter(|value| range.contains(value))
        {
            Some(value) => Ok(Some(value)),
            None => Err(s.error(
                self.get(name)
                    .map_or(Span { file: 0, offset: 0 }, |param| param.span),
                format!(
                    "\"{name}\" is {value}; it can be from {} to {}",
                    range.start(),
                    range.end()
                ),
            )),
        }
    }

    pub(crate) fn bool(&self, s: &Sources, name: &str) -> Result<Option<bool>, SceneError> {
        let Some(param) = self.typed(s, name, &[Type::Bool])? else {
            return Ok(None);
        };
        let Values::Bools(values) = &param.values else {
            return Ok(None);
        };
        Self::one(s, param, values).copied().map(Some)
    }

    pub(crate) fn text(&self, s: &Sources, name: &str) -> Result<Option<&str>, SceneError> {
        let Some(param) = self.typed(s, name, &[Type::Text])? else {
            return Ok(None);
        };
        let Values::Texts(values) = &param.values else {
            return Ok(None);
        };
        Self::one(s, param, values).map(|text| Some(text.as_str()))
    }

    /// The name of a texture; `None` where the parameter is absent or no texture.
    pub(crate) fn texture(&self, s: &Sources, name: &str) -> Result<Option<&str>, SceneError> {
        match self.get(name) {
            Some(param) if param.ty == Type::Texture => match &param.values {
                Values::Texts(values) => Self::one(s, param, values).map(|t| Some(t.as_str())),
                _ => Ok(None),
            },
            _ => Ok(None),
        }
    }

    /// Three numbers of one of the types of points, vectors and normals.
    pub(crate) fn triple(
        &self,
        s: &Sources,
        name: &str,
        ty: Type,
    ) -> Result<Option<[f32; 3]>, SceneError> {
        let Some(param) = self.typed(s, name, &[ty])? else {
            return Ok(None);
        };
        match *param.numbers() {
            [x, y, z] => Ok(Some([x as f32, y as f32, z as f32])),
            ref numbers => Err(s.error(
                param.span,
                format!("\"{name}\" has {} numbers; it takes three", numbers.len()),
            )),
        }
    }

    /// A list of numbers of one of `types`.
    pub(crate) fn numbers(
        &self,
        s: &Sources,
        name: &str,
        types: &[Type],
    ) -> Result<Option<&Param>, SceneError> {
        self.typed(s, name, types)
    }

    pub(crate) fn integers(
        &self,
        s: &Sources,
        name: &str,
    ) -> Result<Option<(&[i64], Span)>, SceneError> {
        Ok(self
            .typed(s, name, &[Type::Integer])?
            .and_then(|param| match &param.values {
                Values::Integers(values) => Some((values.as_slice(), param.span)),
                _ => None,
            }))
    }

    /// A colour of any type.
    pub(crate) fn color_param(
        &self,
        s: &Sources,
        name: &str,
        or_texture: bool,
    ) -> Result<Option<&Param>, SceneError> {
        let mut types = vec![Type::Rgb, Type::Xyz, Type::Blackbody, Type::Spectrum];
        if or_texture {
            types.push(Type::Texture);
        }
        self.typed(s, name, &types)
    }
}
