//! Materials, as data: pbrt-v3's, by its names.

use std::sync::Arc;

use super::texture::Texture;

/// A texture that may be shared.
pub type TextureRef = Arc<Texture>;

/// How a surface scatters light.
#[derive(Clone, Debug)]
pub enum Material {
    /// Diffuse: Lambertian, or Oren-Nayar where sigma > 0.
    Matte {
        /// Diffuse reflectance.
        kd: TextureRef,
        /// Standard deviation of the microfacets' orientation, in degrees.
        sigma: TextureRef,
    },
    /// Diffuse under a glossy coat.
    Plastic {
        /// Diffuse reflectance.
        kd: TextureRef,
        /// Specular reflectance.
        ks: TextureRef,
        /// Roughness of the coat.
        roughness: TextureRef,
        /// The roughness is in `[0, 1]` and to be mapped to a microfacet width.
        remap_roughness: bool,
    },
    /// A perfect mirror.
    Mirror {
        /// Reflectance.
        kr: TextureRef,
    },
    /// Smooth or rough glass.
    Glass {
        /// Reflectance.
        kr: TextureRef,
        /// Transmittance.
        kt: TextureRef,
        /// Index of refraction inside.
        eta: TextureRef,
        /// Roughness along u and v; both 0: smooth.
        roughness: [TextureRef; 2],
        /// See [`Material::Plastic`].
        remap_roughness: bool,
    },
    /// Diffuse, glossy, mirror and transmission at once, and opacity.
    Uber {
        /// Diffuse reflectance.
        kd: TextureRef,
        /// Glossy reflectance.
        ks: TextureRef,
        /// Mirror reflectance.
        kr: TextureRef,
        /// Transmittance.
        kt: TextureRef,
        /// Roughness along u and v.
        roughness: [TextureRef; 2],
        /// How much light the surface stops; the rest goes straight through.
        opacity: TextureRef,
        /// Index of refraction inside.
        eta: TextureRef,
        /// See [`Material::Plastic`].
        remap_roughness: bool,
    },
    /// No surface: rays go straight through (pbrt's "" and "none").
    Interface,
}
