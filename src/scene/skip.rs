//! What is left out where a scene or a job does not need it: named, so that each can be switched off and measured.

/// The skips with their names: what is not here is none.
macro_rules! skips {
    ($($(#[doc = $doc:literal])+ $skip:ident = $name:literal,)+) => {
        /// One thing that is left out where it is not needed.
        ///
        /// All but [`WeightCut`](Self::WeightCut), [`FaintLights`](Self::FaintLights) and
        /// [`Converged`](Self::Converged) leave every pixel as it is, to the last bit; these leave out what is bounded or
        /// estimated, and the render says how much.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Skip {
            $($(#[doc = $doc])+ $skip,)+
        }

        impl Skip {
            /// All of them.
            pub const ALL: &[Self] = &[$(Self::$skip,)+];

            /// Name on the command line.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$skip => $name,)+
                }
            }

            /// Why it changes nothing, or by how much it may.
            #[must_use]
            pub fn why(self) -> &'static str {
                match self {
                    $(Self::$skip => concat!($($doc),+).trim_ascii_start(),)+
                }
            }
        }
    };
}

skips! {
    /// Images of materials that nothing has or no weight takes are not read: no pixel could show them. Off: they are
    /// read if they can be.
    UnusedAssets = "unused-assets",
    /// Texture coordinates of a mesh without images are not stored: nothing is looked up at them.
    Uv = "uv",
    /// Sixteen hits of facets without corner normals are not interpolated: the facet's normal is the result.
    Normals = "normals",
    /// No point of the lens is drawn for a pinhole: it would be multiplied by zero.
    Lens = "lens",
    /// No point of the pixel is drawn for a lone sample, whose place is fixed.
    Jitter = "jitter",
    /// Lights of no colour are dropped: they add zero.
    DarkLights = "dark-lights",
    /// No shadow ray where the surface faces away or is black: whatever it met, zero is added.
    ShadowRays = "shadow-rays",
    /// No shadow ray from the inside of a closed shape to a light outside of it: it meets the shape.
    Enclosed = "enclosed",
    /// After a bounce, no shadow ray to a light that would add less than a sixteenth of the weight cut. Bounded: what it
    /// would add is summed.
    FaintLights = "faint-lights",
    /// No traversal for a ray inside of a convex shape whose box no other one meets: it can only hit that shape, whose
    /// formula answers as the backend's would.
    Inside = "inside",
    /// Shadow rays ask whether anything is in the way, not what is nearest: only the yes or no counts.
    AnyHit = "any-hit",
    /// No power is taken for sixteen hits without a highlight: it would be multiplied by zero.
    Powf = "powf",
    /// Without mirrors and glass the stage of secondary rays is not compiled in: nothing would enter it.
    Secondary = "secondary",
    /// Branches that weigh less than the job says are not traced. Bounded: what they could add is summed.
    WeightCut = "weight-cut",
    /// Packets of camera rays that pass the box around the scene do not go to the backend: they miss all that is in it.
    Bounds = "bounds",
    /// What auxiliary images show is gathered only for those that were asked for: the picture does not look at it.
    Aovs = "aovs",
    /// Pixels that are clean enough get no more samples (`--adaptive`). Estimated: see the error of sampling.
    Converged = "converged",
    /// Hits of shapes and of meshes are told apart only where there are both.
    Geometry = "geometry",
    /// Few rays get a hierarchy that is built quickly: it answers alike, but for ties.
    BuildQuality = "build-quality",
    /// A boundary of Fresnel's between equal indices sends no mirrored ray: its share is zero at every angle.
    Fresnel = "fresnel",
}

impl Skip {
    /// The one of this name.
    #[must_use]
    pub fn parse(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|skip| skip.name() == name)
    }

    /// Whether pixels are the same to the last bit without it; else the difference is bounded or estimated.
    #[must_use]
    pub fn is_exact(self) -> bool {
        !matches!(self, Self::WeightCut | Self::FaintLights | Self::Converged)
    }

    const fn bit(self) -> u32 {
        1 << self as u32
    }
}

/// A set of them: those that are switched on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Skips(u32);

impl Default for Skips {
    fn default() -> Self {
        Self::ALL
    }
}

impl Skips {
    /// Everything is left out that can be.
    pub const ALL: Self = Self((1 << Skip::ALL.len()) - 1);
    /// Nothing is.
    pub const NONE: Self = Self(0);

    /// Whether `skip` is switched on.
    #[inline]
    #[must_use]
    pub const fn has(self, skip: Skip) -> bool {
        self.0 & skip.bit() != 0
    }

    /// The same with `skip` switched off.
    #[must_use]
    pub const fn without(self, skip: Skip) -> Self {
        Self(self.0 & !skip.bit())
    }

    /// Those that are in both sets.
    #[must_use]
    pub const fn and(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    /// Those that are switched off.
    pub fn off(self) -> impl Iterator<Item = Skip> {
        Skip::ALL.iter().copied().filter(move |&skip| !self.has(skip))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_has_a_name_and_a_bit_of_its_own() {
        for &skip in Skip::ALL {
            assert_eq!(Skip::parse(skip.name()), Some(skip));
            let without = Skips::ALL.without(skip);
            assert!(Skips::ALL.has(skip) && !without.has(skip) && !Skips::NONE.has(skip));
            assert_eq!(without.off().collect::<Vec<_>>(), [skip]);
        }
        assert_eq!(Skip::parse("nothing"), None);
        assert_eq!(Skips::NONE.off().count(), Skip::ALL.len());
    }
}
