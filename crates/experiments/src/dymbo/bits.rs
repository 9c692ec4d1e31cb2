//! How many bits a sample are worth sending.

use super::common::{Plant, plants};
use crate::prelude::*;
use fewbits_baselines::dymbo::iterated;
use fewbits_dymbo::{MultibitFilter, ScalarFilter, chain};

parameters! {
    pub struct Parameters {
        plants: Vec<Plant> [; 1..] = plants([(0.9, 0.5), (0.9, 0.05)]) => "Plants, `a:gamma`.",
        bits: Vec<usize> [1..=8; 1..] = (1..=8).collect() => "Bits a sample.",
    }
}

rows! {
    pub struct Rows {
        words: Vec<Row> => "Errors of the filters.",
        successive: Vec<Successive> => "Several bits about one sample.",
    }

    struct Row by "{plant} {bits}" {
        plant: Plant,
        bits: usize => "Word length.",
        c: f64 => "Information of a word against the sample.",
        riccati: f64 ["sigma^2"] => "Predicted steady variance.",
        exact_mse: f64 ["sigma^2"] => "Exact steady mean squared error.",
        loss: f64 => "Exact error over the Kalman filter's.",
        riccati_loss: f64 => "Predicted variance over the Kalman filter's.",
    }

    struct Successive by "{bits}" {
        bits: usize as x("bits") => "Bits about the same sample.",
        batch: f64 as line("Lloyd-Max word") => "1 - c of the Lloyd-Max word.",
        exact_tree: f64 as points("successive, exact means") => "1 - c with thresholds at exact means.",
        claimed: f64 as dashed("successive, as claimed") => "1 - c promised by assuming normal densities, (1 - 2/pi)^m.",
        own_levels: f64 as points("successive, its own levels") => "1 - c true of its levels.",
        centroids: f64 as points("successive, centroids") => "1 - c true of its cells.",
        empty_words: usize => "Words that no sample causes.",
    }
}

pub struct WordLength;

impl Figure for WordLength {
    figure!(Parameters => Rows, "dymbo-bits", "Bits a sample", "",
        "Loss against the Kalman filter when each sample sends a word of the innovation's Lloyd-Max quantizer: predicted \
         (lines) and exact (points). Two bits leave 15 % and three 4 %. Right: what is lost of one sample, 1 - c, by \
         batch words and by successive bits; the usual formula for the latter promises too much.");

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Rows, Error> {
        let row = |&(&plant, &bits): &(&Plant, &usize)| {
            let filter = MultibitFilter::new(plant.model()?, bits)?;
            let (kalman, c) = (plant.kalman_variance()?, filter.information());
            let riccati = plant.model()?.steady_state(c)?.filtered_variance;
            let exact_mse = chain::multibit_mse(&filter)?;
            Ok::<_, Error>(Row {
                plant,
                bits,
                c,
                riccati,
                exact_mse,
                loss: exact_mse / kalman,
                riccati_loss: riccati / kalman,
            })
        };
        let any = Plant { a: 0.9, gamma: 0.5 }.model()?;
        let successive = |bits: usize| {
            let assumed = iterated::normal_assumption_information(bits)?;
            Ok(Successive {
                bits,
                batch: 1.0 - MultibitFilter::new(any, bits)?.information(),
                exact_tree: 1.0 - iterated::exact_tree_information(bits)?,
                claimed: 1.0 - assumed.claimed,
                own_levels: 1.0 - assumed.with_own_levels,
                centroids: 1.0 - assumed.with_centroids,
                empty_words: assumed.empty_words,
            })
        };
        Ok(Rows {
            words: parallel::try_map(&product(&p.plants, &p.bits), row)?,
            successive: (1..=5).map(successive).collect::<Result<_, Error>>()?,
        })
    }

    fn claims(&self, p: &Parameters, rows: &Rows, claims: &mut Claims) {
        let here = claims.at_defaults();
        for curve in rows.words.chunks(p.bits.len()) {
            let plant = curve[0].plant;
            let what = format!("{}: every bit helps", plant.title());
            let losses = curve.iter().map(|r| r.loss);
            here.decreasing(format!("falls-{}-{}", plant.a, plant.gamma), what, losses);
        }
        let longer = rows.words.iter().filter(|r| r.bits > 1);
        let what = "from two bits on the prediction is exact to 0.03 %";
        here.all("riccati", what, longer, |r| (r.exact_mse / r.riccati - 1.0).abs() <= 3e-4);
        let rows = &rows.successive;
        let what = |name: &str| format!("successive bits, {name}: information of bits");
        claims.keyed("claimed", &what("claimed"), rows, |r| 1.0 - r.claimed);
        claims.keyed("own-levels", &what("own-levels"), rows, |r| 1.0 - r.own_levels);
        claims.keyed("centroids", &what("centroids"), rows, |r| 1.0 - r.centroids);
        claims.keyed("exact-tree", &what("exact-tree"), rows, |r| 1.0 - r.exact_tree);
        let what = "the Lloyd-Max word loses less at every length from two bits";
        claims.all("batch-wins", what, rows.iter().filter(|r| r.bits > 1), |r| r.batch < r.exact_tree);
        let empty = rows.last().map(|r| r.empty_words as f64);
        claims.above("empty", "at five bits some successive words never occur", empty, 0.0);
    }

    fn plot(&self, p: &Parameters, rows: &Rows) -> Plot {
        let x = Axis::linear("bits a sample").between(0.7, 8.3);
        let mut left = Panel::new("Loss against word length", x, Axis::log("error over the Kalman filter's, minus 1"));
        for (i, curve) in rows.words.chunks(p.bits.len()).enumerate() {
            let title = curve[0].plant.title();
            let over = |of: fn(&Row) -> f64| points(curve, |r| (r.bits as f64, of(r) - 1.0));
            left = left
                .with(Layer::line(format!("predicted, {title}"), over(|r| r.riccati_loss)).coloured(i))
                .with(Layer::points(format!("exact, {title}"), over(|r| r.loss)).coloured(i));
        }
        let lost = "fraction of the information lost, 1 - c";
        let right =
            plotted(&rows.successive, "Bits about one sample", &[("", "", &|title, x| Panel::semilog(title, x, lost))]);
        Plot::grid(2, [vec![left], right.panels].concat())
    }
}
