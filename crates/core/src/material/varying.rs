//! Laws whose properties vary in space.

use std::borrow::Cow;
use std::sync::Arc;

use super::{Elasticity, Material, MaterialError, PrincipalLaw, PrincipalResponse, Response, StateField};
use crate::tensor::Sym3;

/// A property of a law that varies in space.
#[derive(Debug, Clone, PartialEq)]
pub struct VaryingProperty {
    /// Name in result files.
    pub name: Cow<'static, str>,
    /// Unit as text.
    pub unit: Cow<'static, str>,
    /// A typical value, which replaces the varying values wherever a stiffness is needed as a scale.
    pub typical: f64,
}

/// The values of all properties, as a function of the original position.
pub type PropertiesAt = dyn Fn(&[f64; 3]) -> Vec<f64> + Send + Sync;

/// A law as a function of its properties.
type LawOf<L> = dyn Fn(&[f64]) -> L + Send + Sync;

/// A law of one kind whose properties vary in space: every point has its own properties, which depend on its original
/// position. The properties are stored after the history variables of the law and never change.
pub struct Varying<L> {
    /// History variables of the law, then properties.
    fields: Vec<StateField>,
    n_properties: usize,
    at: Arc<PropertiesAt>,
    law: Arc<LawOf<L>>,
    /// The law with the typical properties.
    typical: L,
    /// Factor by which the strength is divided.
    divided_by: f64,
    /// Duration of the step, [time], for laws that depend on it.
    duration: Option<f64>,
    /// True if the tangent is symmetric whatever the properties are.
    is_symmetric: bool,
}

/// Relative change applied to a property, absolute if the property is 0, to detect whether the symmetry of the tangent
/// depends on that property, as it does if the angles of friction and dilation are equal.
const CHANGE: f64 = 1e-3;

impl<L: Material> Varying<L> {
    /// The law whose properties are given by `at`, in the order of `properties`; `law` creates the law with given
    /// properties.
    pub fn new(
        properties: &[VaryingProperty],
        at: Arc<PropertiesAt>,
        law: impl Fn(&[f64]) -> L + Send + Sync + 'static,
    ) -> Self {
        let values: Vec<f64> = properties.iter().map(|property| property.typical).collect();
        let typical = law(&values);
        let stays_symmetric = |changed: usize| {
            let mut values = values.clone();
            values[changed] = if values[changed] == 0.0 { CHANGE } else { (1.0 + CHANGE) * values[changed] };
            law(&values).tangent_is_symmetric()
        };
        let is_symmetric = typical.tangent_is_symmetric() && (0..values.len()).all(stays_symmetric);
        let field = |property: &VaryingProperty| StateField {
            name: property.name.clone(),
            unit: property.unit.clone(),
            initial: property.typical,
        };
        let fields = typical.state_fields().iter().cloned().chain(properties.iter().map(field)).collect();
        Varying {
            fields,
            n_properties: properties.len(),
            at,
            law: Arc::new(law),
            typical,
            divided_by: 1.0,
            duration: None,
            is_symmetric,
        }
    }

    /// History variables of the law, and properties.
    fn split<'a>(&self, history: &'a [f64]) -> (&'a [f64], &'a [f64]) {
        history.split_at(history.len() - self.n_properties)
    }

    /// Evaluates the law of a point.
    fn with<T>(&self, properties: &[f64], evaluate: impl FnOnce(&dyn Material) -> T) -> T {
        let law = (self.law)(properties);
        if self.divided_by == 1.0 && self.duration.is_none() {
            return evaluate(&law);
        }
        let divided = if self.divided_by == 1.0 { None } else { law.with_strength_divided(self.divided_by) };
        let law = divided.as_deref().unwrap_or(&law);
        match self.duration.and_then(|duration| law.for_duration(duration)) {
            Some(timed) => evaluate(timed.as_ref()),
            None => evaluate(law),
        }
    }
}

impl<L: std::fmt::Debug> std::fmt::Debug for Varying<L> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let properties = &self.fields[self.fields.len() - self.n_properties..];
        let names: Vec<&str> = properties.iter().map(|field| field.name.as_ref()).collect();
        f.debug_struct("Varying").field("typical", &self.typical).field("properties", &names).finish()
    }
}

impl<L: Material + Clone + 'static> PrincipalLaw for Varying<L> {
    fn respond(
        &self,
        trial: [f64; 3],
        old: &[f64],
        new: &mut [f64],
    ) -> Result<PrincipalResponse, MaterialError> {
        let (own, properties) = self.split(old);
        let (new_own, kept) = new.split_at_mut(own.len());
        kept.copy_from_slice(properties);
        // Either all laws of one kind are formulated in principal axes, or none is.
        self.with(properties, |law| law.principal().map(|law| law.respond(trial, own, new_own)))
            .unwrap_or(Err(MaterialError::NoResponse))
    }
}

impl<L: Material + Clone + 'static> Material for Varying<L> {
    fn state_fields(&self) -> &[StateField] {
        &self.fields
    }

    fn strain_measure(&self) -> super::StrainMeasure {
        self.typical.strain_measure()
    }

    fn update(&self, trial: &Sym3, old: &[f64], new: &mut [f64]) -> Result<Response, MaterialError> {
        let (own, properties) = self.split(old);
        let (new_own, kept) = new.split_at_mut(own.len());
        kept.copy_from_slice(properties);
        self.with(properties, |law| law.update(trial, own, new_own))
    }

    fn principal(&self) -> Option<&dyn PrincipalLaw> {
        self.typical.principal().map(|_| self as &dyn PrincipalLaw)
    }

    fn initial_history_at(&self, position: &[f64; 3]) -> Vec<f64> {
        let properties = (self.at)(position);
        let mut history = self.with(&properties, |law| law.initial_history_at(position));
        history.extend(properties);
        history
    }

    fn start_from(&self, elastic_strain: &Sym3, volume_ratio: f64, history: &mut [f64]) {
        let (own, properties) = history.split_at_mut(history.len() - self.n_properties);
        self.with(properties, |law| law.start_from(elastic_strain, volume_ratio, own));
    }

    fn keep_deformation(&self, strains: [&Sym3; 2], history: &mut [f64]) {
        let (own, properties) = history.split_at_mut(history.len() - self.n_properties);
        self.with(properties, |law| law.keep_deformation(strains, own));
    }

    fn elastic_strain(&self, tau: &Sym3, history: &[f64]) -> Result<Sym3, MaterialError> {
        let (own, properties) = self.split(history);
        self.with(properties, |law| law.elastic_strain(tau, own))
    }

    fn linear_elasticity(&self, history: &[f64]) -> Option<Elasticity> {
        let (own, properties) = self.split(history);
        self.with(properties, |law| law.linear_elasticity(own))
    }

    fn energy(&self, elastic_strain: &Sym3, history: &[f64]) -> f64 {
        let (own, properties) = self.split(history);
        self.with(properties, |law| law.energy(elastic_strain, own))
    }

    fn plastic_work(&self, history: &[f64]) -> f64 {
        let (own, properties) = self.split(history);
        self.with(properties, |law| law.plastic_work(own))
    }

    fn has_yielded(&self, initial: &[f64], history: &[f64]) -> bool {
        let (own, properties) = self.split(history);
        self.with(properties, |law| law.has_yielded(self.split(initial).0, own))
    }

    fn with_strength_divided(&self, factor: f64) -> Option<Box<dyn Material>> {
        let divided_by = self.divided_by * factor;
        let is_symmetric = self.typical.with_strength_divided(divided_by)?.tangent_is_symmetric();
        Some(Box::new(Varying {
            fields: self.fields.clone(),
            n_properties: self.n_properties,
            at: self.at.clone(),
            law: self.law.clone(),
            typical: self.typical.clone(),
            divided_by,
            duration: self.duration,
            is_symmetric: self.is_symmetric && is_symmetric,
        }))
    }

    fn for_duration(&self, duration: f64) -> Option<Box<dyn Material>> {
        self.typical.for_duration(duration)?;
        Some(Box::new(Varying {
            fields: self.fields.clone(),
            n_properties: self.n_properties,
            at: self.at.clone(),
            law: self.law.clone(),
            typical: self.typical.clone(),
            divided_by: self.divided_by,
            duration: Some(duration),
            is_symmetric: self.is_symmetric,
        }))
    }

    fn tangent_is_symmetric(&self) -> bool {
        self.is_symmetric
    }
}
