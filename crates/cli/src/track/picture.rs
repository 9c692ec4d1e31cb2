//! The picture of a level: band, values, estimates.

use super::report::{BAND, value_of};
use crate::plot::{Layer, Picture, Thinned};
use crate::track_options::TrackOptions;

pub(super) struct Picked {
    pub(super) seconds: f64,
    pub(super) estimate: (f64, f64),
    pub(super) full: Option<f64>,
}

/// What is drawn.
pub(super) struct Drawn {
    pub(super) path: Thinned<Picked>,
    pub(super) measured: Thinned<(f64, f64)>,
}

impl Drawn {
    /// `has_full`: whether there are estimates from values in full.
    pub(super) fn picture(&self, options: &TrackOptions, title: String, has_full: bool) -> Picture {
        let points = self.path.points();
        let value = |number: f64| value_of(options.transform, number);
        let edge = |sign: f64| {
            let at = |picked: &Picked| (picked.seconds, value(picked.estimate.0 + sign * BAND * picked.estimate.1));
            points.iter().map(at).collect::<Vec<_>>()
        };
        let mut layers = vec![
            Layer::Band {
                lower: edge(-1.0),
                upper: edge(1.0),
                colour: 0,
            },
            Layer::Dots {
                points: self.measured.points().to_vec(),
                colour: 6,
                name: if options.reports {
                    String::new()
                } else {
                    "measurements".to_owned()
                },
            },
        ];
        if has_full {
            layers.push(Layer::Line {
                points: points
                    .iter()
                    .filter_map(|p| Some((p.seconds, value(p.full?))))
                    .collect(),
                colour: 1,
                name: "estimate from values in full".to_owned(),
            });
        }
        layers.push(Layer::Line {
            points: points.iter().map(|p| (p.seconds, value(p.estimate.0))).collect(),
            colour: 0,
            name: "estimate, band of 95 %".to_owned(),
        });
        Picture {
            title,
            x: "seconds since the first row".to_owned(),
            y: "level".to_owned(),
            is_log: false,
            is_map: false,
            layers,
        }
    }
}
