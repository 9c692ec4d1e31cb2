//! The number types of samples.

mod sealed {
    pub trait Sealed {}
}

/// A number that is compared with thresholds of its own type: a code of a converter, a fixed-point number or a float.
pub trait Sample: Copy + PartialOrd + sealed::Sealed {
    /// Whether it is not NaN; always true for integers.
    fn is_number(self) -> bool;
    /// Whether it is neither NaN nor infinite; always true for integers.
    fn is_finite(self) -> bool;
    /// The value for error messages; not exact beyond 53 bits.
    fn to_f64(self) -> f64;
}

macro_rules! codes {
    ($($code:ty)*) => {$(
        impl sealed::Sealed for $code {}
        impl Sample for $code {
            fn is_number(self) -> bool {
                true
            }
            fn is_finite(self) -> bool {
                true
            }
            fn to_f64(self) -> f64 {
                self as f64
            }
        }
    )*};
}

codes! { u8 i8 u16 i16 u32 i32 i64 }

macro_rules! floats {
    ($($float:ty)*) => {$(
        impl sealed::Sealed for $float {}
        impl Sample for $float {
            fn is_number(self) -> bool {
                !self.is_nan()
            }
            fn is_finite(self) -> bool {
                self.is_finite()
            }
            fn to_f64(self) -> f64 {
                self.into()
            }
        }
    )*};
}

floats! { f32 f64 }
