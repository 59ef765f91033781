//! Materials, as data: pbrt-v3's, by its names.

use std::sync::Arc;

pub use super::texture::TextureRef;

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
    /// A conductor's rough surface.
    Metal {
        /// Index of refraction.
        eta: TextureRef,
        /// Absorption coefficient.
        k: TextureRef,
        /// Roughness along u and v.
        roughness: [TextureRef; 2],
        /// See [`Material::Plastic`].
        remap_roughness: bool,
    },
    /// Diffuse under a coat that takes the more light the flatter it falls \[Ashikhmin2000\].
    Substrate {
        /// Diffuse reflectance.
        kd: TextureRef,
        /// Reflectance of the coat at normal incidence.
        ks: TextureRef,
        /// Roughness along u and v.
        roughness: [TextureRef; 2],
        /// See [`Material::Plastic`].
        remap_roughness: bool,
    },
    /// Diffuse and glossy on both sides.
    Translucent {
        /// Diffuse part.
        kd: TextureRef,
        /// Glossy part.
        ks: TextureRef,
        /// How much of both is reflected.
        reflect: TextureRef,
        /// How much of both is transmitted.
        transmit: TextureRef,
        /// Roughness.
        roughness: TextureRef,
        /// See [`Material::Plastic`].
        remap_roughness: bool,
    },
    /// Two materials at once.
    Mix {
        /// The share of the first, by colour.
        amount: TextureRef,
        /// Both.
        parts: [Arc<Material>; 2],
    },
    /// A material on a surface that seems to be raised.
    Bumped {
        /// The material.
        base: Arc<Material>,
        /// By how much it is raised, in scene units.
        height: TextureRef,
    },
    /// No surface: rays go straight through (pbrt's "" and "none").
    Interface,
}
