//! GIMP bodies of revolution with loaded sides.

use super::Check;
use crate::quoting::quote;
use crate::{Idealisation, Method};

impl Check<'_> {
    /// Warns of GIMP bodies of revolution with loads on a surface. GIMP computes the circumferential strain from the
    /// mean of the basis function over the domain. In a uniform state, however, internal forces balance a pressure on a
    /// side that lies within a cell only if the strain is computed from the mean of the values at both ends of the
    /// domain, as in CPDI.
    pub(super) fn loaded_rings(&mut self) {
        let deck = self.deck;
        if deck.analysis.idealisation != Idealisation::Axisymmetric {
            return;
        }
        for (number, body) in deck.bodies.iter().enumerate().filter(|(_, body)| body.method == Method::Gimp) {
            let is_of_body = |name: &str| deck.surfaces.iter().any(|s| s.name == name && s.body == body.name);
            let mut loads = deck.loads.iter().filter(|load| !load.magnitude().1);
            let Some(load) = loads.find(|load| load.surface().is_some_and(is_of_body)) else { continue };
            let message = format!(
                "the load {} acts on a side of the body of revolution {}, whose GIMP points have wrong stresses where this \
                 side lies within a cell",
                quote(load.name()),
                quote(&body.name)
            );
            let help = "use `method: cpdi2` or `cpdi1`, which balance the pressure exactly";
            self.warn("D067", &format!("/bodies/{number}/method"), message, help);
        }
    }
}
