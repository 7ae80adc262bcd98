//! The types of numbers that a header can name.

/// A type of numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Type {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Type {
    /// All names, for messages.
    pub(super) const NAMES: &str =
        "char uchar short ushort int uint float double int8 uint8 int16 uint16 int32 uint32 float32 float64";

    /// The type with this name, old or new.
    pub(super) fn of(name: &[u8]) -> Option<Self> {
        Some(match name {
            b"char" | b"int8" => Self::I8,
            b"uchar" | b"uint8" => Self::U8,
            b"short" | b"int16" => Self::I16,
            b"ushort" | b"uint16" => Self::U16,
            b"int" | b"int32" => Self::I32,
            b"uint" | b"uint32" => Self::U32,
            b"float" | b"float32" => Self::F32,
            b"double" | b"float64" => Self::F64,
            _ => return None,
        })
    }

    /// Bytes of one in a binary file.
    #[inline]
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// Whether it has whole numbers only.
    pub(super) fn is_whole(self) -> bool {
        !matches!(self, Self::F32 | Self::F64)
    }

    /// The number in the first bytes of `bytes`, most significant byte first if `big`.
    ///
    /// # Panics
    /// If they are too few.
    #[inline]
    pub(super) fn number(self, big: bool, bytes: &[u8]) -> f64 {
        match self {
            Self::F32 => f64::from(f32::from_bits(bits32(big, bytes))),
            Self::F64 => {
                let bytes = *bytes.first_chunk().expect("there are eight bytes");
                f64::from_bits(if big { u64::from_be_bytes(bytes) } else { u64::from_le_bytes(bytes) })
            }
            _ => self.whole(big, bytes) as f64,
        }
    }

    /// The same for a type of whole numbers; fractions of others are cut off.
    ///
    /// # Panics
    /// If there are too few bytes.
    #[inline]
    pub(super) fn whole(self, big: bool, bytes: &[u8]) -> i64 {
        match self {
            Self::I8 => i64::from(bytes[0] as i8),
            Self::U8 => i64::from(bytes[0]),
            Self::I16 => i64::from(bits16(big, bytes) as i16),
            Self::U16 => i64::from(bits16(big, bytes)),
            Self::I32 => i64::from(bits32(big, bytes) as i32),
            Self::U32 => i64::from(bits32(big, bytes)),
            Self::F32 | Self::F64 => self.number(big, bytes) as i64,
        }
    }
}

#[inline]
fn bits16(big: bool, bytes: &[u8]) -> u16 {
    let bytes = *bytes.first_chunk().expect("there are two bytes");
    if big { u16::from_be_bytes(bytes) } else { u16::from_le_bytes(bytes) }
}

#[inline]
fn bits32(big: bool, bytes: &[u8]) -> u32 {
    let bytes = *bytes.first_chunk().expect("there are four bytes");
    if big { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) }
}
