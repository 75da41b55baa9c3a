//! Fig. 6: a Gaussian and its split in equal parts, for two values of u.

use anyhow::Result;
use nalgebra::{DMatrix, DVector, Vector2};
use search::gaussian::Gaussian;
use search::mixture::Mixture;
use search::split_merge::{Split, split};

use crate::draw::figure::{Figure, Row, THIRD};
use crate::draw::map::{Map, draw_mode};
use crate::draw::plot::Axis;

pub fn figure() -> Result<Figure> {
    let mean = DVector::from_vec(vec![0.0, 0.0]);
    let covariance = DMatrix::from_row_slice(2, 2, &[3.0, 1.2, 1.2, 1.2]);
    let parent = Mixture::single(Gaussian::new(mean, covariance));
    let equal = Split::default();
    let children = |u: f64| split(&parent, 0, Split { u, ..equal });
    let panels = [
        panel("the Gaussian", &parent, &parent),
        panel("split, u = √¾", &parent, &children(equal.u)),
        panel("split, u = 0.4", &parent, &children(0.4)),
    ];
    Ok(Figure {
        stem: "fig6",
        title: "Splitting a Gaussian along its principal direction",
        caption:
            "Shades: density of the Gaussian before the split. Ellipses at one and two standard \
                  deviations: the Gaussian (left) and the two halves of Eq. (9) with \
                  α = β = ½. Mean and covariance of the halves together are those of the Gaussian \
                  for every u; u = 0 would leave the density as it is."
                .into(),
        rows: Ok(vec![Row::Thirds(panels.into())]),
    })
}

fn panel(name: &'static str, parent: &Mixture, mixture: &Mixture) -> crate::draw::svg::Panel {
    let density = |theta: &Vector2<f64>| {
        parent.log_density(&DVector::from_column_slice(theta.as_slice())).exp()
    };
    let map = Map {
        x: Axis { label: "Θ₁", min: -5.0, max: 5.0 },
        y: Axis { label: name, min: -4.0, max: 4.0 },
        reward: &density,
        max: density(&Vector2::zeros()),
    };
    let mut plot = map.draw((THIRD, 270.0), name, &[]);
    for mode in mixture.modes() {
        draw_mode(&mut plot, &mode, "learnt");
    }
    plot.panel
}
