//! Concentration of a point source that releases at a constant rate, in closed form.

use super::axis::Axis;
use super::half_space::{Flux, Wall};
use super::space::{ImpulseResponse, Space, step_response};
use crate::Error;
use crate::source_model::{Homogeneous, Receptor, SourceGradient, SourceModel};
use fewbits_numerics::error::{positive, refuse, within};
use fewbits_numerics::kernels::scalar::exp;
use fewbits_numerics::normal::erfcx;
use nalgebra::Vector3;
use std::f64::consts::PI;

/// Shorter distances are replaced by this one, in metres: the concentration is infinite at the source.
const CLOSEST: f64 = 1e-3;
const SQRT_PI: f64 = 1.772_453_850_905_516;
/// Largest absolute value, in SI units, of diffusivity, wind, distance and age; the smallest of divisors is its reciprocal. Within these
/// limits no product of a closed form overflows. At larger distances the concentration is 0; a larger age gives the steady state.
const MAX_MAGNITUDE: f64 = 1e60;
pub(super) const MIN_MAGNITUDE: f64 = 1e-60;

/// Lower boundary of the medium.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Ground {
    /// Nothing: the medium is unbounded.
    None,
    /// Ground at `z = 0` with the given wall law, `z >= 0`.
    Wall(Wall),
    /// Impermeable ground at `z = 0`; the same as `Wall(Wall::IMPERMEABLE)`.
    Impermeable,
}

/// Unbounded air, or the half-space `z >= 0` above ground, with a uniform wind.
///
/// The concentration of a continuous source of unit rate has a closed form for unbounded air, and for impermeable or absorbing ground
/// under a horizontal wind. Over permeable ground it is an integral, computed to relative accuracy 1e-12.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Air {
    diffusivity: f64,
    wind: Vector3<f64>,
    ground: Ground,
    closest: f64,
    space: Space,
    /// Norm of the wind, m/s.
    speed: f64,
    /// `1 / (2 diffusivity)` and `1 / (8 pi diffusivity)`.
    half_resistance: f64,
    strength: f64,
}

impl Air {
    /// Air of the given diffusivity (m^2/s) and wind (m/s).
    ///
    /// # Errors
    /// If `diffusivity` is not in `[1e-60, 1e60]`, a component of `wind` not in `[-1e60, 1e60]`, or the wind blows across the ground. For
    /// the last case use a [`Space`], where the wall's condition states which flux it is about.
    pub fn new(diffusivity: f64, wind: Vector3<f64>, ground: Ground) -> Result<Self, Error> {
        within("diffusivity", positive("diffusivity", diffusivity)?, MIN_MAGNITUDE, MAX_MAGNITUDE)?;
        for component in wind.iter() {
            within("wind", *component, -MAX_MAGNITUDE, MAX_MAGNITUDE)?;
        }
        let open = |v| Axis::open(diffusivity)?.with_wind(v, Flux::Total);
        let vertical = match ground {
            Ground::None => open(wind.z)?,
            _ if wind.z != 0.0 => return refuse("wind.z", wind.z, "0 above ground"),
            Ground::Impermeable => Axis::half_space(diffusivity, Wall::IMPERMEABLE)?,
            Ground::Wall(wall) => Axis::half_space(diffusivity, wall)?,
        };
        Ok(Self {
            diffusivity,
            wind,
            ground,
            closest: CLOSEST,
            space: Space::new([open(wind.x)?, open(wind.y)?, vertical])?,
            speed: wind.norm(),
            half_resistance: 0.5 / diffusivity,
            strength: 0.125 / (PI * diffusivity),
        })
    }

    /// The same air with another shortest distance, in metres: shorter distances are replaced by it. Default 1 mm.
    ///
    /// # Errors
    /// If `closest` is not in `[1e-60, 1e60]`.
    pub fn with_closest(self, closest: f64) -> Result<Self, Error> {
        Ok(Self {
            closest: within("closest", closest, MIN_MAGNITUDE, MAX_MAGNITUDE)?,
            ..self
        })
    }

    /// The same air with another wind, m/s.
    ///
    /// # Errors
    /// As [`Air::new`].
    pub(crate) fn with_wind(&self, wind: Vector3<f64>) -> Result<Self, Error> {
        Self::new(self.diffusivity, wind, self.ground)?.with_closest(self.closest)
    }

    /// The same air with another diffusivity, m^2/s.
    fn with_diffusivity(&self, diffusivity: f64) -> Result<Self, Error> {
        Self::new(diffusivity, self.wind, self.ground)?.with_closest(self.closest)
    }

    /// Wind, m/s.
    pub(crate) fn wind(&self) -> &Vector3<f64> {
        &self.wind
    }

    /// Sign of the image source below the ground; `None` over permeable ground, where there is no image.
    fn image(&self) -> Option<f64> {
        match self.ground {
            Ground::None => Some(0.0),
            Ground::Impermeable => Some(1.0),
            Ground::Wall(wall) if wall == Wall::IMPERMEABLE => Some(1.0),
            Ground::Wall(wall) if wall == Wall::ABSORBING => Some(-1.0),
            Ground::Wall(_) => None,
        }
    }

    fn has_ground(&self) -> bool {
        self.ground != Ground::None
    }

    /// The age for the closed forms, limited to their range; `None` if the concentration is 0: before the release, below ground, too far
    /// away.
    fn counted_age(&self, field: &Vector3<f64>, source: &Vector3<f64>, age: f64) -> Option<f64> {
        let below = self.has_ground() && (field.z < 0.0 || source.z < 0.0);
        if age < MIN_MAGNITUDE || below || (field - source).amax() > MAX_MAGNITUDE {
            return None;
        }
        Some(if age > MAX_MAGNITUDE { MAX_MAGNITUDE } else { age })
    }

    /// Concentration at `field`, kg/m^3 per kg/s, of a source at `source` that has released for `age` seconds. Zero at age zero
    /// and before, and below the ground.
    pub fn concentration(&self, field: &Vector3<f64>, source: &Vector3<f64>, age: f64) -> f64 {
        let Some(age) = self.counted_age(field, source, age) else {
            return 0.0;
        };
        let Some(sign) = self.image() else {
            return step_response(&self.space, field, source, age, self.closest);
        };
        let direct = self.terms(&(field - source), age).sum;
        if sign == 0.0 {
            return direct;
        }
        if source.z == 0.0 {
            // The image falls on the source.
            return (1.0 + sign) * direct;
        }
        let mirrored = Vector3::new(source.x, source.y, -source.z);
        (direct + sign * self.terms(&(field - mirrored), age).sum).max(0.0)
    }

    /// Concentration (as [`concentration`](Self::concentration)) and its gradient with respect to the source position, per metre.
    ///
    /// The derivative with respect to the height of a source **on** the ground is the one-sided limit, 0 over impermeable
    /// ground. Over permeable ground the gradient is a central difference of relative step 1e-5, good to about eight digits.
    pub fn source_gradient(&self, field: &Vector3<f64>, source: &Vector3<f64>, age: f64) -> SourceGradient {
        let Some(age) = self.counted_age(field, source, age) else {
            return SourceGradient {
                value: 0.0,
                gradient: Vector3::zeros(),
            };
        };
        let Some(sign) = self.image() else {
            return self.numeric_gradient(field, source, age);
        };
        let (value, slope) = self.at_offset(&(field - source), age);
        let mirrored = Vector3::new(source.x, source.y, -source.z);
        let (image, image_slope) = if sign == 0.0 {
            (0.0, Vector3::zeros())
        } else {
            self.at_offset(&(field - mirrored), age)
        };
        // The offset decreases as the source moves up; that of the image increases with the source's height.
        let image_gradient = Vector3::new(-image_slope.x, -image_slope.y, image_slope.z);
        SourceGradient {
            value: value + sign * image,
            gradient: -slope + sign * image_gradient,
        }
    }

    fn numeric_gradient(&self, field: &Vector3<f64>, source: &Vector3<f64>, age: f64) -> SourceGradient {
        let reach = (field - source)
            .norm()
            .max(self.closest)
            .min((4.0 * self.diffusivity * age).sqrt());
        let step = 1e-5 * reach;
        let at = |i: usize, by: f64| {
            let mut moved = *source;
            moved[i] += by;
            self.concentration(field, &moved, age)
        };
        let gradient = Vector3::from_fn(|i, _| {
            if i == 2 && source.z < step {
                // For a source on the ground: one-sided, second order.
                (4.0 * at(2, step) - at(2, 2.0 * step) - 3.0 * at(2, 0.0)) / (2.0 * step)
            } else {
                (at(i, step) - at(i, -step)) / (2.0 * step)
            }
        });
        SourceGradient {
            value: self.concentration(field, source, age),
            gradient,
        }
    }

    /// Concentration in unbounded air at an offset `field - source`, and the quantities that its gradient shares.
    ///
    /// `c = e^{v.d/2k} [e^{-rV/2k} erfc(zm) + e^{rV/2k} erfc(zp)] / (8 pi k r)`, `zm, zp = (r -+ V t) / sqrt(4 k t)`. The factor `g =
    /// exp(-|d - v t|^2 / 4 k t)` of both terms is taken out; `erfcx` of the arguments remains, and nothing overflows. Takes at most two
    /// exponentials and two `erfcx`, without wind one of each.
    #[inline(always)]
    fn terms(&self, offset: &Vector3<f64>, age: f64) -> Terms {
        let distance = offset.norm();
        let r = distance.max(self.closest);
        let prefactor = self.strength / r;
        let narrowness = (4.0 * self.diffusivity * age).sqrt().recip();
        if self.speed == 0.0 {
            let z = r * narrowness;
            let g = exp(-z * z);
            let term = prefactor * g * erfcx(z);
            return Terms {
                distance,
                narrowness,
                g: prefactor * g,
                sum: 2.0 * term,
                difference: 0.0,
            };
        }
        let mut along = self.wind.dot(offset);
        if distance < r {
            // An offset shorter than the closest distance is lengthened in its own direction.
            along *= if distance > 0.0 { r / distance } else { 0.0 };
        }
        let drift = self.speed * age;
        let (minus, plus) = ((r - drift) * narrowness, (r + drift) * narrowness);
        // |d - v t|^2 = minus^2 spread^2 + 2 (r V - v.d) t. The difference of the vectors would cancel.
        let lag = ((along - r * self.speed) * self.half_resistance).min(0.0);
        let g = exp(lag - minus * minus);
        let near = g * erfcx(minus.abs());
        // erfc(-x) = 2 - erfc(x).
        let first = if minus >= 0.0 { near } else { 2.0 * exp(lag) - near };
        let second = g * erfcx(plus);
        Terms {
            distance,
            narrowness,
            g: prefactor * g,
            sum: prefactor * (first + second),
            difference: prefactor * (second - first),
        }
    }

    /// Concentration in unbounded air and its gradient with respect to the offset `field - source`.
    fn at_offset(&self, offset: &Vector3<f64>, age: f64) -> (f64, Vector3<f64>) {
        let terms = self.terms(offset, age);
        let direction = if terms.distance > 0.0 {
            offset / terms.distance
        } else {
            Vector3::zeros()
        };
        let radial = -terms.sum / terms.distance.max(self.closest)
            + self.speed * self.half_resistance * terms.difference
            - terms.g * terms.narrowness * (4.0 / SQRT_PI);
        (terms.sum, self.wind * (terms.sum * self.half_resistance) + direction * radial)
    }
}

/// Quantities used by both the concentration and its gradient.
struct Terms {
    distance: f64,
    /// `1 / sqrt(4 k t)`.
    narrowness: f64,
    /// `exp(-|d - v t|^2 / 4 k t) / (8 pi k r)`.
    g: f64,
    /// Concentration per unit rate.
    sum: f64,
    /// The term of `zp` minus that of `zm`.
    difference: f64,
}

impl ImpulseResponse for Air {
    fn green(&self, field: &Vector3<f64>, source: &Vector3<f64>, age: f64) -> f64 {
        self.space.green(field, source, age)
    }

    fn diffusivity(&self) -> f64 {
        self.diffusivity
    }
}

/// Relative step of the central difference in the diffusivity.
const DIFFUSIVITY_STEP: f64 = 1e-5;

impl SourceModel for Air {
    fn concentration(&self, receptor: &Receptor, source: &Vector3<f64>, age: f64) -> f64 {
        self.concentration(&receptor.place, source, age)
    }

    fn source_gradient(&self, receptor: &Receptor, source: &Vector3<f64>, age: f64) -> SourceGradient {
        self.source_gradient(&receptor.place, source, age)
    }

    /// Upper bound from the largest slope of the log concentration within the square (see [`Homogeneous`]): the concentration grows at most
    /// by `exp(slope * reach)`. It is also at most that of a source straight upwind in unbounded air at the smallest distance of the
    /// square, or twice that over ground.
    fn variation(&self, receptor: &Receptor, source: &Vector3<f64>, half_width: f64, age: f64) -> f64 {
        let here = self.concentration(&receptor.place, source, age);
        if age < MIN_MAGNITUDE {
            return here;
        }
        let age = age.min(MAX_MAGNITUDE);
        let reach = std::f64::consts::SQRT_2 * half_width;
        let offset = receptor.place - source;
        let near = offset
            .z
            .hypot((offset.x.hypot(offset.y) - reach).max(0.0))
            .clamp(self.closest, MAX_MAGNITUDE);
        let far = offset.norm() + reach;
        let slope = near.recip() + 2.0 * far / (4.0 * self.diffusivity * age) + self.speed / self.diffusivity;
        let downwind = self.wind.try_normalize(0.0).unwrap_or_else(Vector3::x);
        let highest = if self.has_ground() { 2.0 } else { 1.0 } * self.terms(&(downwind * near), age).sum;
        let growth = (slope * reach).exp_m1();
        // Zero concentration times infinite growth would be NaN.
        if growth * here < highest {
            growth * here
        } else {
            highest
        }
    }

    /// True for squares above ground.
    fn admits(&self, source: &Vector3<f64>, _: f64) -> bool {
        !self.has_ground() || source.z >= 0.0
    }

    fn homogeneous(&self) -> Option<Homogeneous> {
        Some(Homogeneous {
            diffusivity: self.diffusivity,
            wind: self.wind.xy(),
            speed: self.speed,
            closest: self.closest,
        })
    }

    /// A central difference of relative step 1e-5, good to about nine digits.
    fn diffusivity_slope(&self, receptor: &Receptor, source: &Vector3<f64>, age: f64) -> Option<f64> {
        let at = |share: f64| {
            let air = self.with_diffusivity(share * self.diffusivity).ok()?;
            Some(air.concentration(&receptor.place, source, age))
        };
        let difference = at(1.0 + DIFFUSIVITY_STEP)? - at(1.0 - DIFFUSIVITY_STEP)?;
        Some(difference / (2.0 * DIFFUSIVITY_STEP * self.diffusivity))
    }
}
