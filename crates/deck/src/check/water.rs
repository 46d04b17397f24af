//! Checks of the water of a deck that need no mesh.

use super::Check;
use crate::quoting::quote;
use crate::span::escape;
use crate::water::{Drainage, LevelDeck};
use crate::{AXES, ControlDeck, MaterialDeck, StepsDeck, Until};
use mpm_core::terms::WATER;

impl Check<'_> {
    /// Checks the water, and what materials and stages say of it.
    pub(super) fn water(&mut self) {
        self.keys_of_water();
        for (pointer, level) in self.deck.levels() {
            self.level(&pointer, level);
        }
        let deck = self.deck;
        for (name, material) in &deck.materials {
            self.drainage(&format!("/materials/{}", escape(name)), name, material);
        }
        if deck.has_level() {
            self.name_of_water();
            self.direction_of_gravity();
            self.water_with_inertia();
            self.water_of_unknown_factors();
        }
        self.pores_in_stages();
        self.water_twice_or_lost();
    }

    /// Warns of water that counts twice, is lost, or acts at a place that the points do not resolve.
    fn water_twice_or_lost(&mut self) {
        let deck = self.deck;
        let is_undrained =
            |name: &str| deck.materials.get(name).is_some_and(|m| m.drainage() == Some(Drainage::Undrained));
        let hydrostatic = deck.loads.iter().enumerate().filter(|(_, load)| load.is_hydrostatic());
        for (number, load) in hydrostatic.filter(|_| deck.has_level()) {
            let message = format!(
                "the hydrostatic load {} adds to the water of the level, which acts on all surfaces by itself",
                quote(load.name())
            );
            self.warn(
                "D099",
                &format!("/loads/{number}"),
                message,
                "remove the load, unless it is of another liquid",
            );
        }
        for (pointer, level) in deck.levels() {
            let LevelDeck::Line(points) = level else { continue };
            let steep = |pair: &[[f64; 2]]| (pair[1][1] - pair[0][1]).abs() > pair[1][0] - pair[0][0];
            if let Some(number) = points.windows(2).position(steep) {
                let message = "the level rises by more than 1 in 1 here, and each point sees the level above its centre \
                               only: the horizontal force of the water is exact only if this part spans many points"
                    .to_owned();
                let help = "let the level rise over several cells";
                self.warn("D099", &format!("{pointer}/{}", number + 1), message, help);
            }
        }
        for (number, stage) in deck.stages.iter().enumerate() {
            let has_undrained = deck.bodies.iter().any(|body| is_undrained(&body.material))
                || deck.stages[..=number]
                    .iter()
                    .flat_map(|s| s.material.values())
                    .any(|name| is_undrained(name));
            let levels = deck.stages[..number].iter().filter_map(|earlier| earlier.water.as_ref());
            let first = deck.water.as_ref().and_then(|water| water.level.as_ref());
            let before = levels.map(|water| &water.level).next_back().or(first);
            let has_changed = stage.water.as_ref().is_some_and(|water| before != Some(&water.level));
            if has_changed && has_undrained {
                let message = "the level changes while bodies are undrained: where it falls, the weight of the water that \
                               their pores keep is lost, and where it rises, it is added"
                    .to_owned();
                let help = "give bodies that keep their water a saturated density and a level below them, or change the \
                            level while they are drained";
                self.warn("D099", &format!("/stages/{number}/water"), message, help);
            }
            for (body, _) in stage.material.iter().filter(|(_, material)| is_undrained(material)) {
                let before =
                    deck.stages[..number].iter().rev().find_map(|earlier| earlier.material.get(body));
                let first = deck.bodies.iter().find(|other| other.name == *body).map(|other| &other.material);
                if before.or(first).is_some_and(|before| is_undrained(before)) {
                    let message = format!(
                        "the body {} loses its excess pore pressure over this stage, although it stays undrained: a new \
                         material begins without it",
                        quote(body)
                    );
                    let help = "keep the material of the body, or let it drain";
                    let at = format!("/stages/{number}/material/{}", escape(body));
                    self.warn("D099", &at, message, help);
                }
            }
        }
    }

    /// Checks that the water states what belongs together.
    fn keys_of_water(&mut self) {
        let deck = self.deck;
        if let Some(water) = &deck.water {
            let at = "/water".to_owned();
            match (&water.level, water.unit_weight, water.bulk_modulus) {
                (Some(_), None, _) => {
                    let message = "the water has a level, but no weight";
                    self.error(
                        "D091",
                        &at,
                        message,
                        "add its weight per volume, such as `unit_weight: 9.81e3`",
                    );
                }
                (None, Some(_), _) => {
                    let message = "the water has a weight, but no level below which it stands";
                    let help = "add `level: 4`, or the points of a polyline, or remove `unit_weight`";
                    self.error("D091", &format!("{at}/unit_weight"), message, help);
                }
                (None, None, None) => {
                    let help = "add `unit_weight` and `level`, or the `bulk_modulus` for undrained materials";
                    self.error("D091", &at, "the water has neither a level nor a stiffness", help);
                }
                _ => {}
            }
        }
        if !deck.has_level() {
            for number in (0..deck.stages.len()).filter(|number| deck.stages[*number].water.is_some()) {
                let message = "a stage changes the level of water that the deck does not have";
                let help =
                    "add `water: {unit_weight: 9.81e3, level: 4}` to the deck, with the level at the start";
                self.error("D091", &format!("/stages/{number}/water"), message, help);
            }
        }
    }

    /// Checks that no load, tool or condition has the name under which the force of the water is reported.
    fn name_of_water(&mut self) {
        let deck = self.deck;
        let loads = deck.loads.iter().map(|load| load.name()).enumerate().map(|named| ("loads", named));
        let tools =
            deck.tools.iter().map(|tool| tool.name.as_str()).enumerate().map(|named| ("tools", named));
        for (section, (number, _)) in loads.chain(tools).filter(|(_, (_, name))| *name == WATER) {
            let message =
                format!("the columns of {} in `history.csv` hold the force of the water", quote(WATER));
            let help = "give this another name";
            self.error("D091", &format!("/{section}/{number}/name"), message, help);
        }
    }

    /// Checks that a level is finite, and that a polyline has one height everywhere.
    fn level(&mut self, pointer: &str, level: &LevelDeck) {
        match level {
            LevelDeck::Height(height) if height.is_finite() => {}
            LevelDeck::Line(points) if points.iter().flatten().all(|x| x.is_finite()) => {
                let turn = points.windows(2).position(|pair| pair[0][0] >= pair[1][0]);
                if let Some(turn) = turn {
                    let message = format!(
                        "the first coordinates of a level increase from point to point, but {} does not follow {}",
                        points[turn + 1][0],
                        points[turn][0]
                    );
                    let help = "sort the points, and replace a vertical step by a slope over several cells";
                    self.error("D091", &format!("{pointer}/{}", turn + 1), message, help);
                }
            }
            _ => self.error("D091", pointer, "the level is not finite", "give a finite height"),
        }
    }

    /// Checks what a material says of the water in its pores.
    fn drainage(&mut self, pointer: &str, name: &str, material: &MaterialDeck) {
        let deck = self.deck;
        let (drainage, porosity) = (material.drainage(), material.porosity());
        let name = quote(name);
        match drainage {
            Some(Drainage::Coupled) => {
                let message =
                    format!("flow through the pores of the material {name} with time is not available");
                let help = "use `undrained` for fast loading and `drained` for slow loading; a stage that changes the \
                            material from undrained to drained releases the excess pore pressure";
                self.error("D094", &format!("{pointer}/drainage"), message, help);
            }
            Some(Drainage::Dry) if porosity.is_some() => {
                let message = format!("the material {name} is dry, but has pores for water");
                let help =
                    "remove `porosity`: water lifts the whole volume of a dry material; or remove `drainage`";
                self.error("D095", &format!("{pointer}/porosity"), message, help);
            }
            Some(Drainage::Undrained) => self.pore_stiffness(pointer, &name, material),
            _ => {}
        }
        let is_undrained = drainage == Some(Drainage::Undrained);
        if material.undrained_poisson().is_some() && !is_undrained {
            let at = format!("{pointer}/undrained_poisson");
            if self.is_written(&at) {
                let message = "`undrained_poisson` has no effect: the material is not undrained".to_owned();
                self.warn_at_key("D037", &at, message, "remove it, or add `drainage: undrained`");
            }
        }
        if !deck.has_level() && !is_undrained {
            for key in ["porosity", "drainage"] {
                let at = format!("{pointer}/{key}");
                let is_reserved = drainage == Some(Drainage::Coupled);
                if self.is_written(&at) && !is_reserved {
                    let message = format!("`{key}` has no effect: the deck has no water level");
                    let help = format!(
                        "remove it, or add `water: {{unit_weight: 9.81e3, level: 4}}`; `{key}` then acts"
                    );
                    self.warn_at_key("D037", &at, message, &help);
                }
            }
        }
    }

    /// Checks that the stiffness of the water follows, for an undrained material.
    fn pore_stiffness(&mut self, pointer: &str, name: &str, material: &MaterialDeck) {
        let deck = self.deck;
        if material.pore_stiffness(deck.water.as_ref()).is_some() {
            return;
        }
        if let Some(undrained) = material.undrained_poisson() {
            let at = format!("{pointer}/undrained_poisson");
            match (material.young(), material.poisson()) {
                (Some(_), Some(poisson)) => {
                    let message = format!(
                        "the material {name} has the Poisson's ratio {poisson}, and {undrained} without drainage: water \
                         would have no stiffness"
                    );
                    self.error("D093", &at, message, "give a value between `poisson` and 0.5, such as 0.495");
                }
                _ => {
                    let message = format!(
                        "the elasticity of the material {name} varies, so that one undrained Poisson's ratio gives no stiffness of the water"
                    );
                    let help = "give `porosity` and `water: {bulk_modulus: ...}` instead";
                    self.error("D093", &at, message, help);
                }
            }
            return;
        }
        let lacks_modulus = deck.water.as_ref().is_none_or(|water| water.bulk_modulus.is_none());
        let missing = match (material.porosity().is_none(), lacks_modulus) {
            (true, true) => "neither its porosity nor the bulk modulus of the water is stated",
            (true, false) => "its porosity is not stated",
            _ => "the bulk modulus of the water is not stated",
        };
        let message =
            format!("the stiffness of the water in the undrained material {name} is unknown: {missing}");
        let help = "add `porosity` to the material and `water: {bulk_modulus: 2.2e9}` to the deck, or \
                    `undrained_poisson: 0.495` to a material with `young` and `poisson`";
        self.error("D093", &format!("{pointer}/drainage"), message, help);
    }

    /// Checks that gravity acts downwards along the last axis, along which the depth of water counts.
    fn direction_of_gravity(&mut self) {
        let (deck, last) = (self.deck, self.dimensions() - 1);
        for (number, load) in deck.loads.iter().enumerate() {
            let Some(acceleration) = load.acceleration() else { continue };
            let along: Vec<f64> = acceleration.iter().take(last + 1).copied().collect();
            let is_down =
                along.iter().take(last).all(|a| *a == 0.0) && along.get(last).is_none_or(|a| *a < 0.0);
            if !is_down {
                let message = format!(
                    "the load {} does not act downwards along {}, but water stands level below a height along {}",
                    quote(load.name()),
                    AXES[last],
                    AXES[last]
                );
                let help =
                    format!("let gravity act along {} only, below 0, or remove the `level`", AXES[last]);
                self.error("D091", &format!("/loads/{number}/acceleration"), message, help);
            }
        }
    }

    /// Refuses water in motion with inertia.
    fn water_with_inertia(&mut self) {
        let deck = self.deck;
        for number in 0..deck.courses().len() {
            if deck.dynamic(number).is_none() {
                continue;
            }
            let at = match deck.stages.is_empty() {
                true => "/dynamic".to_owned(),
                false => format!("/stages/{number}/dynamic"),
            };
            let message = "water at a level has no inertia: pore water would not move with the ground";
            let help = "remove `dynamic`, or remove the `level` and give the materials their saturated density and the \
                        buoyancy as a load of type `body-force`";
            self.error("D097", &at, message, help);
        }
    }

    /// Refuses changes of the weight or of the level of the water where load factors follow from equilibrium, or where a
    /// stage may end before its time.
    fn water_of_unknown_factors(&mut self) {
        let deck = self.deck;
        let has_unknown = |steps: &StepsDeck| {
            matches!(steps.control, ControlDeck::ArcLength { .. } | ControlDeck::Displacement { .. })
        };
        let has_gravity = deck.loads.iter().any(|load| load.acceleration().is_some());
        if has_gravity && deck.steps.as_ref().is_some_and(has_unknown) {
            let message =
                "the factor of gravity, and with it the weight of the water, follows from equilibrium";
            let help = "use `stages`: one in which gravity reaches its factor, and one with this control";
            self.error("D098", "/steps/control", message, help);
        }
        for (number, stage) in deck.stages.iter().enumerate() {
            if has_unknown(&stage.steps) {
                for name in stage.factors.keys() {
                    let is_gravity =
                        |load: &crate::LoadDeck| load.name() == name && load.acceleration().is_some();
                    if deck.loads.iter().any(is_gravity) {
                        let message = format!(
                            "the factor of {}, and with it the weight of the water, follows from equilibrium",
                            quote(name)
                        );
                        let help = "let an earlier stage with prescribed factors change the gravity";
                        let at = format!("/stages/{number}/factors/{}", escape(name));
                        self.error("D098", &at, message, help);
                    }
                }
            }
            let is_prescribed = matches!(stage.steps.control, ControlDeck::Load {});
            if stage.water.is_some() && (!is_prescribed || stage.steps.until == Until::Limit) {
                let message =
                    "the level of the water changes with time, but this stage may end before its time";
                let help =
                    "change the level in a stage of its own, with prescribed factors, before this stage";
                self.error("D098", &format!("/stages/{number}/water"), message, help);
            }
        }
    }

    /// Checks that a body keeps its pores where a stage changes its material.
    fn pores_in_stages(&mut self) {
        let deck = self.deck;
        if !deck.has_level() {
            return;
        }
        for (number, stage) in deck.stages.iter().enumerate() {
            for (body, material) in &stage.material {
                let Some(present) = deck.bodies.iter().find(|other| other.name == *body) else { continue };
                let pores = |name: &str| {
                    let material = deck.materials.get(name)?;
                    Some(match material.drainage() {
                        Some(Drainage::Dry) => Some(0.0),
                        _ => material.porosity(),
                    })
                };
                let (Some(before), Some(now)) = (pores(&present.material), pores(material)) else { continue };
                if before != now {
                    let message = format!(
                        "the material {} has other pores than {}, the first material of the body {}",
                        quote(material),
                        quote(&present.material),
                        quote(body)
                    );
                    let help =
                        "give both materials the same `porosity`: the points keep their mass and their pores";
                    self.error("D095", &format!("/stages/{number}/material/{}", escape(body)), message, help);
                }
            }
        }
    }
}
