//! All laws have the properties on which the solver relies. For a new law, add one line to the list.

mod return_mapping;

use proptest::prelude::*;

use super::conformance::{Deviation, Property, check, deviations};
use super::*;

/// The laws that this test and the test of the weak forms cover.
pub(crate) fn laws() -> Vec<Box<dyn Material>> {
    vec![
        Box::new(Hencky::new(12e6, 0.2)),
        Box::new(NeoHookean::new(12e6, 0.2)),
        Box::new(NeoHookean::new(1e3, -0.4)),
        Box::new(VonMises::new(1e6, 0.3, 20e3)),
        Box::new(VonMises::new(1e6, 0.3, 20e3).hardening(0.4e6)),
        Box::new(Tresca::new(1e6, 0.3, 20e3)),
        Box::new(Tresca::new(1e6, 0.3, 20e3).limiting(StrengthMeasure::Cauchy)),
        Box::new(Tresca::new(1e6, 0.3, 20e3).softening(5e3, Softening::over(0.4))),
        Box::new(MohrCoulomb::new(1e6, 0.2, CLAY).limiting(StrengthMeasure::Kirchhoff)),
        Box::new(MohrCoulomb::new(1e6, 0.3, Friction { dilation_angle: 0.0, ..CLAY })),
        Box::new(MohrCoulomb::new(1e6, 0.3, Friction { dilation_angle: 10.0, ..CLAY }).tensile_strength(5e3)),
        Box::new(softening_sand()),
        Box::new(DruckerPrager::new(1e6, 0.3, CLAY, Match::Compression).limiting(StrengthMeasure::Kirchhoff)),
        Box::new(DruckerPrager::new(1e6, 0.3, Friction { dilation_angle: 5.0, ..CLAY }, Match::PlaneStrain)),
        Box::new(DruckerPrager::new(1e6, 0.3, CLAY, Match::PlaneStrain).limiting(StrengthMeasure::Kirchhoff)),
    ]
}

const CLAY: Friction = Friction { cohesion: 10e3, friction_angle: 25.0, dilation_angle: 25.0 };

/// All options of the Mohr-Coulomb surface: dilation, a cut-off, softening, and the Cauchy stress.
fn softening_sand() -> MohrCoulomb {
    let peak = Friction { cohesion: 20e3, friction_angle: 35.0, dilation_angle: 12.0 };
    let residual = Friction { cohesion: 2e3, friction_angle: 28.0, dilation_angle: 0.0 };
    MohrCoulomb::new(1e6, 0.3, peak).tensile_strength(8e3).softening(residual, Softening::over(0.5))
}

/// Cam-clays with a constant shear modulus and with a shear modulus that grows with the pressure.
pub(crate) fn cam_clays() -> Vec<ModifiedCamClay> {
    let constant = CamClay {
        compression_index: 0.09,
        swelling_index: 0.02,
        critical_state_ratio: 1.05,
        shear_modulus: 3e6,
        shear_modulus_ratio: 0.0,
        overconsolidation_ratio: 1.0,
        reference_pressure: 100e3,
    };
    let growing =
        CamClay { shear_modulus: 1e6, shear_modulus_ratio: 8.0, overconsolidation_ratio: 2.5, ..constant };
    [constant, growing].map(ModifiedCamClay::new).into()
}

/// A normally consolidated Cam-clay whose shear modulus grows with the pressure.
fn soft_cam_clay() -> ModifiedCamClay {
    ModifiedCamClay::new(CamClay {
        compression_index: 0.09,
        swelling_index: 0.018,
        critical_state_ratio: 1.05,
        shear_modulus: 2e6,
        shear_modulus_ratio: 2.0,
        overconsolidation_ratio: 1.0,
        reference_pressure: 100e3,
    })
}

fn conforms_to_round_off(law: &dyn Material, strain: Sym3) {
    let found = deviations(law, &strain);
    for Deviation { property, error, round_off } in &found {
        assert!(error <= round_off, "{property:?} of {law:?} at {strain:?}: {error:e}");
    }
    // A law need not have an inverse, but these laws do.
    let has_inverse = found.iter().any(|deviation| deviation.property == Property::Inverse);
    assert!(has_inverse || strain.norm() > 0.02);
}

proptest! {
    #[test]
    fn both_measures_of_a_strain_agree(e in prop::array::uniform6(-0.3..0.3f64)) {
        let strain = Sym3(e);
        let b = StrainMeasure::Logarithmic.left_cauchy_green(&strain);
        let back = StrainMeasure::LeftCauchyGreen.logarithmic(&((b - Sym3::IDENTITY) * 0.5));
        prop_assert!((back - strain).norm() < 1e-15 + 1e-14 * strain.norm());
    }

    #[test]
    fn every_law_conforms(e in prop::array::uniform6(-0.3..0.3f64)) {
        for law in cam_clays() {
            conforms_to_round_off(&law, Sym3(e) * 0.2);
            conforms_to_round_off(&law, Sym3([e[0], e[1], e[2], 0.0, 0.0, e[5]]) * 0.1);
        }
        for law in laws() {
            conforms_to_round_off(law.as_ref(), Sym3(e));
            conforms_to_round_off(law.as_ref(), Sym3([e[0], e[1], e[2], 0.0, 0.0, e[5]]));
            conforms_to_round_off(law.as_ref(), Sym3(e) * 1e-2);
        }
    }
}

/// If the shear modulus has a constant part, the stored energy can stay convex beyond the largest shear strain at which
/// it is convex without this part.
#[test]
fn cam_clay_finds_the_elastic_strain_of_every_stable_stress() {
    for (constant, pressure, ratios) in [(0.5e6, 100e3, &[0.5, 1.0, 2.0][..]), (0.02e6, 500e3, &[0.2, 0.28])]
    {
        let law = ModifiedCamClay::new(CamClay {
            compression_index: 0.09,
            swelling_index: 0.01,
            critical_state_ratio: 1.05,
            shear_modulus: constant,
            shear_modulus_ratio: 10.0,
            overconsolidation_ratio: 5.0,
            reference_pressure: 100e3,
        });
        for ratio in ratios {
            // In triaxial compression, q is the difference of the principal stresses.
            let q = ratio * pressure;
            let tau =
                Sym3([-pressure + q / 3.0, -pressure + q / 3.0, -pressure - 2.0 * q / 3.0, 0.0, 0.0, 0.0]);
            let strain = law.elastic_strain(&tau, &[]).unwrap();
            let mut history = vec![0.0; law.state_fields().len()];
            law.start_from(&strain, 1.0, &mut history);
            let found = law.update(&strain, &history.clone(), &mut history).unwrap().tau;
            assert!((found - tau).norm() < 1e-9 * tau.norm(), "{constant}, {ratio}: {found:?}, not {tau:?}");
        }
        // The largest ratio q/P of the second law is below 0.5; the first law has no largest ratio.
        let q = 0.5 * pressure;
        let beyond =
            Sym3([-pressure + q / 3.0, -pressure + q / 3.0, -pressure - 2.0 * q / 3.0, 0.0, 0.0, 0.0]);
        assert_eq!(law.elastic_strain(&beyond, &[]).is_err(), constant < 0.1e6);
    }
}

#[test]
fn the_check_of_a_law_finds_nothing_in_those_of_the_library() {
    for law in laws() {
        assert_eq!(check(law.as_ref(), 0.3), [], "{law:?}");
    }
    // A Cam-clay has a stress at zero strain, and those that are normally consolidated yield there.
    for law in cam_clays().into_iter().chain([soft_cam_clay()]) {
        for largest in [0.06, 0.01, 1e-3] {
            assert_eq!(check(&law, largest), [], "{law:?} {largest}");
        }
    }
}

/// A law whose stress and tangent are wrong.
#[derive(Debug)]
struct Wrong(Hencky);

impl Material for Wrong {
    fn state_fields(&self) -> &[StateField] {
        &[]
    }

    fn update(&self, trial: &Sym3, old: &[f64], new: &mut [f64]) -> Result<Response, MaterialError> {
        let mut response = self.0.update(trial, old, new)?;
        response.tangent[(0, 1)] *= 1.01;
        response.tau.0[2] *= 1.01;
        Ok(response)
    }

    fn elastic_strain(&self, tau: &Sym3, history: &[f64]) -> Result<Sym3, MaterialError> {
        self.0.elastic_strain(tau, history)
    }

    fn energy(&self, elastic_strain: &Sym3, history: &[f64]) -> f64 {
        self.0.energy(elastic_strain, history)
    }
}

#[test]
fn the_check_of_a_law_names_what_is_wrong() {
    let found = check(&Wrong(Hencky::new(12e6, 0.2)), 0.1);
    let properties: Vec<Property> = found.iter().map(|finding| finding.property).collect();
    for property in
        [Property::Tangent, Property::Symmetry, Property::Isotropy, Property::Inverse, Property::Potential]
    {
        assert!(properties.contains(&property), "{property:?} in {properties:?}");
    }
    assert_eq!(properties.len(), 5, "{properties:?}");
    let tangent = found.iter().find(|finding| finding.property == Property::Tangent).unwrap();
    assert!(tangent.error > 1e-4 && tangent.error < 1e-2, "{tangent}");
    assert!(tangent.to_string().starts_with("Tangent at the logarithmic strain ["), "{tangent}");
}

#[test]
fn small_strains_have_the_stiffness_of_linear_elasticity() {
    let linear = Elasticity::from_young_poisson(12e6, 0.2);
    for law in laws().iter().take(2) {
        let at_rest = law.update(&Sym3::ZERO, &[], &mut []).unwrap();
        assert_eq!(at_rest.tau, Sym3::ZERO);
        assert!((at_rest.tangent - linear.tangent()).norm() < 1e-15 * linear.tangent().norm());
    }
}

#[test]
fn a_strain_that_is_no_number_is_an_error() {
    for law in laws() {
        let old: Vec<f64> = law.state_fields().iter().map(|f| f.initial).collect();
        let bad = Sym3([f64::NAN, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(law.update(&bad, &old, &mut old.clone()), Err(MaterialError::NotFinite));
    }
    let inside_out = Sym3([-0.6, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let law = NeoHookean::new(1.0, 0.3);
    assert_eq!(law.update(&inside_out, &[], &mut []), Err(MaterialError::NotFinite));
}

#[test]
fn a_stress_far_above_the_moduli_has_no_strain() {
    for poisson in [0.2, -0.4] {
        let law = NeoHookean::new(1.0, poisson);
        for stress in [1e300, -1e300, -1e40] {
            let found = law.elastic_strain(&(Sym3::IDENTITY * stress), &[]);
            assert_eq!(found, Err(MaterialError::NoStrain), "{poisson} {stress}");
        }
    }
}

/// Uniaxial stress: Kirchhoff stress σ and plastic logarithmic strain κ along x, with bisection for the transverse
/// strain. After yield, σ grows by √(3/2) H per unit of κ.
#[test]
fn hardening_is_linear_in_uniaxial_tension() {
    let (young, poisson, radius, modulus) = (1e6, 0.3, 20e3, 0.4e6);
    let law = VonMises::new(young, poisson, radius).hardening(modulus);
    for axial in [0.03, 0.05, 0.2, 0.5] {
        let at = |across: f64| {
            let mut kappa = [0.0];
            let trial = Sym3([axial, across, across, 0.0, 0.0, 0.0]);
            let response = law.update(&trial, &[0.0], &mut kappa).unwrap();
            (response.tau, kappa[0])
        };
        let (mut low, mut high) = (-axial, 0.0);
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            *if at(middle).0.0[1] > 0.0 { &mut high } else { &mut low } = middle;
        }
        let (tau, kappa) = at(low);
        let expected = 1.5f64.sqrt() * (radius + modulus * kappa);
        assert!(kappa > 0.0 && (tau.0[0] / expected - 1.0).abs() < 1e-10, "{tau:?} {kappa}");
        assert!(
            (axial - kappa - tau.0[0] / young).abs() < 1e-10,
            "elastic and plastic strain make up the whole"
        );
    }
}

/// One large step has the same result as many small steps if the flow direction is constant: the return mapping is then
/// exact.
#[test]
fn proportional_flow_does_not_depend_on_the_steps() {
    let law = VonMises::new(1e6, 0.3, 20e3).hardening(0.4e6);
    let direction = Sym3([0.1, -0.03, -0.07, 0.02, 0.01, -0.04]);
    let mut whole = [0.0];
    let one = law.update(&direction, &[0.0], &mut whole).unwrap();
    let (mut elastic, mut old) = (Sym3::ZERO, [0.0]);
    for _ in 0..10 {
        let mut new = [0.0];
        elastic = law.update(&(elastic + direction * 0.1), &old, &mut new).unwrap().elastic_strain;
        old = new;
    }
    assert!((old[0] - whole[0]).abs() < 1e-14 && (elastic - one.elastic_strain).norm() < 1e-15);
}

#[test]
fn associated_flow_on_the_kirchhoff_stress_is_symmetric() {
    for matched in [Match::Compression, Match::Extension, Match::PlaneStrain, Match::Inscribed] {
        let law = DruckerPrager::new(1e6, 0.3, CLAY, matched);
        assert!(!law.tangent_is_symmetric());
        assert!(law.limiting(StrengthMeasure::Kirchhoff).tangent_is_symmetric(), "{matched:?}");
    }
}

/// A single point with an unsymmetric tangent prevents the solver from storing only half of the stiffness.
#[test]
fn a_varying_law_is_symmetric_only_if_it_is_so_everywhere() {
    let around = |typical: f64, law: fn(&[f64]) -> MohrCoulomb| {
        let property = VaryingProperty { name: "property".into(), unit: "-".into(), typical };
        Varying::new(&[property], std::sync::Arc::new(move |x: &[f64; 3]| vec![typical + x[0]]), law)
    };
    let varying = |law| around(25.0, law);
    let associated_at_the_typical_point = varying(|p| {
        MohrCoulomb::new(1e6, 0.3, Friction { friction_angle: p[0], ..CLAY })
            .limiting(StrengthMeasure::Kirchhoff)
    });
    let associated = varying(|p| {
        MohrCoulomb::new(1e6, 0.3, Friction { cohesion: p[0], ..CLAY }).limiting(StrengthMeasure::Kirchhoff)
    });
    assert!(!associated_at_the_typical_point.tangent_is_symmetric() && associated.tangent_is_symmetric());
    let without_friction_at_the_typical_point = around(0.0, |p| {
        let angles = Friction { friction_angle: p[0], dilation_angle: 0.0, ..CLAY };
        MohrCoulomb::new(1e6, 0.3, angles).limiting(StrengthMeasure::Kirchhoff)
    });
    assert!(!without_friction_at_the_typical_point.tangent_is_symmetric());
}

/// Divided by a factor below 1, the strength is larger than the strength of the law; the angle of dilation stays.
#[test]
fn a_law_with_more_friction_than_dilation_is_not_symmetric() {
    let angles = Friction { friction_angle: 25.0, dilation_angle: 25.0, ..CLAY };
    let associated = move |cohesion| {
        MohrCoulomb::new(1e6, 0.3, Friction { cohesion, ..angles }).limiting(StrengthMeasure::Kirchhoff)
    };
    let property = VaryingProperty { name: "cohesion".into(), unit: "force/area".into(), typical: 1e4 };
    let at = std::sync::Arc::new(|x: &[f64; 3]| vec![1e4 + x[0]]);
    let varying = Varying::new(&[property], at, move |p| associated(p[0]));
    let laws: [&dyn Material; 2] = [&associated(1e4), &varying];
    for law in laws {
        let is_symmetric = |factor| law.with_strength_divided(factor).unwrap().tangent_is_symmetric();
        assert!(law.tangent_is_symmetric() && is_symmetric(1.2) && !is_symmetric(0.8), "{law:?}");
    }
}

/// A point yields if it flows, not if it is strained elastically or starts with a stress.
#[test]
fn a_point_has_yielded_once_it_has_flowed() {
    let clays = cam_clays().into_iter().map(|law| Box::new(law) as Box<dyn Material>);
    let mut flowing = 0;
    for law in laws().into_iter().chain(clays) {
        let initial = law.initial_history();
        let mut stressed = initial.clone();
        law.start_from(&Sym3([-0.01, -0.02, -0.01, 0.0, 0.0, 0.0]), 0.97, &mut stressed);
        assert!(!law.has_yielded(&initial, &stressed), "{law:?}");
        for trial in [Sym3([-1e-6, -1e-6, -1e-6, 0.0, 0.0, 1e-7]), Sym3([0.05, -0.08, 0.0, 0.0, 0.0, 0.1])] {
            let mut new = stressed.clone();
            let Ok(response) = law.update(&trial, &stressed, &mut new) else { continue };
            let has_flowed = (response.elastic_strain - trial).norm() > 1e-12;
            flowing += usize::from(has_flowed);
            assert_eq!(law.has_yielded(&initial, &new), has_flowed, "{law:?}");
        }
    }
    assert!(flowing >= 12, "{flowing}");
}
