//! The picture of a path among anchors.

use super::anchors::Anchor;
use super::report::BAND;
use crate::plot::{Layer, Picture};
use nalgebra::Vector2;

/// Corners of a drawn ellipse's cross, and how many there are along a path.
const CROSSES: usize = 25;

/// The path with its bands, and the anchors.
pub(super) fn picture(
    anchors: &[Anchor],
    path: &[(Vector2<f64>, [f64; 2])],
    ranges: usize,
    bits_per_range: f64,
) -> Picture {
    let mut layers: Vec<Layer> = Vec::new();
    for (place, deviations) in path.iter().step_by((path.len() / CROSSES).max(1)) {
        for axis in 0..2 {
            let mut ends = [(place.x, place.y); 2];
            for (end, sign) in ends.iter_mut().zip([-1.0, 1.0]) {
                let step = sign * BAND * deviations[axis];
                *end = if axis == 0 {
                    (end.0 + step, end.1)
                } else {
                    (end.0, end.1 + step)
                };
            }
            layers.push(Layer::Line {
                points: ends.to_vec(),
                colour: 5,
                name: String::new(),
            });
        }
    }
    layers.push(Layer::Line {
        points: path.iter().map(|(place, _)| (place.x, place.y)).collect(),
        colour: 0,
        name: "path, crosses of 95 %".to_owned(),
    });
    layers.push(Layer::Dots {
        points: anchors.iter().map(|(_, place)| (place.x, place.y)).collect(),
        colour: 1,
        name: "anchors".to_owned(),
    });
    for (name, place) in anchors {
        layers.push(Layer::Label {
            at: (place.x, place.y),
            text: format!(" {name}\n"),
        });
    }
    Picture {
        title: format!("{ranges} ranges of {bits_per_range:.2} bits"),
        x: "x".to_owned(),
        y: "y".to_owned(),
        is_log: false,
        is_map: true,
        layers,
    }
}
