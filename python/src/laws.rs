//! Constitutive laws that the interpreter evaluates, and laws of the library that the interpreter can call.
//!
//! Strains and stresses pass between Rust and Python as rows xx, yy, zz, √2 xy, √2 yz, √2 xz: in this layout the scalar
//! product of two rows is that of the tensors, and a tangent is a 6 × 6 matrix.

use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use mpm::deck::MaterialDeck;
use mpm::deck::load::{LoadedDeck, OwnLaw};
use mpm::material::conformance::check;
use mpm::material::{
    BatchError, BatchLaw, Material, MaterialError, Response, StateField, StrainMeasure, respond_alone,
};
use mpm::tensor::{Sym3, Tangent};
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArrayDyn};
use pyo3::gc::{PyTraverseError, PyVisit};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::matrix;
use crate::errors::Raised;

/// Index of each component in the order of the library, which is xx, yy, zz, √2 yz, √2 xz, √2 xy.
const PLACE: [usize; 6] = [0, 1, 2, 5, 3, 4];

fn row(tensor: &Sym3) -> [f64; 6] {
    PLACE.map(|place| tensor.0[place])
}

fn tensor(row: &[f64]) -> Sym3 {
    let mut tensor = Sym3::ZERO;
    PLACE.iter().zip(row).for_each(|(place, value)| tensor.0[*place] = *value);
    tensor
}

/// What a law defined in Python states once.
#[derive(Debug, Clone)]
struct Facts {
    fields: Vec<StateField>,
    measure: StrainMeasure,
    is_symmetric: bool,
}

impl Facts {
    fn new(adapter: &Bound<'_, PyAny>) -> PyResult<Facts> {
        let fields: Vec<(String, String, f64)> = adapter.getattr("fields")?.extract()?;
        let is_logarithmic: bool = adapter.getattr("is_logarithmic")?.extract()?;
        let field = |(name, unit, initial): (String, String, f64)| StateField {
            name: name.into(),
            unit: unit.into(),
            initial,
        };
        Ok(Facts {
            fields: fields.into_iter().map(field).collect(),
            measure: if is_logarithmic { StrainMeasure::Logarithmic } else { StrainMeasure::LeftCauchyGreen },
            is_symmetric: adapter.getattr("is_symmetric")?.extract()?,
        })
    }
}

/// The laws of a run, keyed by material name.
#[derive(Clone)]
pub struct Laws {
    list: Vec<(String, Given)>,
    calls: Calls,
}

/// A law that replaces the law of a material.
#[derive(Clone)]
enum Given {
    /// The package's adapter around an object of the user.
    Adapter(Facts, Arc<Py<PyAny>>),
    /// A law of the program, as the material of a deck. It runs as in a deck, without the interpreter.
    BuiltIn(serde_json::Value),
}

impl Given {
    fn new(law: &Bound<'_, PyAny>) -> PyResult<Given> {
        match law.cast::<BuiltIn>() {
            Ok(built_in) => Ok(Given::BuiltIn(built_in.get().material.clone())),
            Err(_) => Ok(Given::Adapter(Facts::new(law)?, Arc::new(law.clone().unbind()))),
        }
    }
}

/// State that all calls of the laws share.
#[derive(Clone, Default)]
struct Calls {
    /// The first exception.
    raised: Arc<Mutex<Option<PyErr>>>,
    /// True once the interpreter must not be called any more.
    are_over: Arc<AtomicBool>,
}

impl Laws {
    /// Laws from a dictionary of adapters and of laws of the program.
    pub fn new(laws: &Bound<'_, PyDict>) -> PyResult<Laws> {
        let law =
            |(name, law): (Bound<'_, PyAny>, Bound<'_, PyAny>)| Ok((name.extract()?, Given::new(&law)?));
        Ok(Laws { list: laws.iter().map(law).collect::<PyResult<_>>()?, calls: Calls::default() })
    }

    /// Replaces laws of a deck with these laws.
    pub fn replace(&self, deck: &mut LoadedDeck) -> Result<(), Raised> {
        for (name, given) in &self.list {
            let Some(material) = deck.deck.materials.get_mut(name) else {
                let known: Vec<String> =
                    deck.deck.materials.keys().map(|known| format!("{known:?}")).collect();
                let known = match &known[..] {
                    [] => "the deck has none".to_owned(),
                    [one] => format!("the only material is {one}"),
                    several => format!("the materials are {}", several.join(", ")),
                };
                return Err(Raised::misuse(format!("there is no material {name:?}; {known}")));
            };
            match given {
                Given::BuiltIn(law) => *material = with_density_of(material, law)?,
                Given::Adapter(facts, adapter) => {
                    let (facts, adapter) = (facts.clone(), Arc::clone(adapter));
                    let law = PythonLaw { facts, adapter, calls: self.calls.clone() };
                    deck.laws.insert(name.clone(), OwnLaw(Arc::new(move || Box::new(law.clone()))));
                }
            }
        }
        Ok(())
    }

    /// True if there are no laws.
    pub fn are_none(&self) -> bool {
        self.list.is_empty()
    }

    /// Shows the objects of users to the cycle collector of Python.
    pub fn traverse(&self, visit: &PyVisit<'_>) -> Result<(), PyTraverseError> {
        self.list.iter().try_for_each(|(_, given)| match given {
            Given::Adapter(_, adapter) => visit.call(adapter.as_ref()),
            Given::BuiltIn(_) => Ok(()),
        })
    }

    /// The first exception that a law has raised.
    pub fn take_raised(&self) -> Option<PyErr> {
        self.calls.raised.lock().ok()?.take()
    }

    /// An error, whose cause is the exception that a law has raised, if any.
    pub fn blamed(&self, py: Python<'_>, error: Raised) -> PyErr {
        let error = PyErr::from(error);
        if let Some(raised) = self.take_raised() {
            error.set_cause(py, Some(raised));
        }
        error
    }

    /// Stops all calls of laws: the run is abandoned, or the interpreter is about to end.
    pub fn end_calls(&self) {
        self.calls.are_over.store(true, Ordering::SeqCst);
    }
}

/// A law of the program, with the density that the deck states for the material whose law it replaces.
fn with_density_of(material: &MaterialDeck, law: &serde_json::Value) -> Result<MaterialDeck, Raised> {
    let unusable = |error: serde_json::Error| Raised::misuse(format!("the material cannot be used: {error}"));
    let mut document = law.clone();
    if let Some(entries) = document.as_object_mut() {
        entries.remove("density");
        let density = material.density().map(serde_json::to_value).transpose().map_err(unusable)?;
        entries.extend(density.map(|density| ("density".to_owned(), density)));
    }
    serde_json::from_value(document).map_err(unusable)
}

/// The answer of a law.
struct Answer {
    stress: Vec<f64>,
    elastic_strain: Vec<f64>,
    tangent: Vec<f64>,
    history: Vec<f64>,
}

/// Calls an adapter, which returns contiguous arrays of the right shapes.
fn call(py: Python<'_>, adapter: &Py<PyAny>, strain: &[f64], history: &[f64]) -> PyResult<Answer> {
    let found = adapter.call_method1(py, "respond", <(_, _)>::from(rows(py, strain, history)?))?;
    let arrays: [PyReadonlyArrayDyn<'_, f64>; 4] = found.extract(py)?;
    let [stress, elastic_strain, tangent, history] =
        arrays.map(|array| array.as_slice().map(<[f64]>::to_vec));
    Ok(Answer { stress: stress?, elastic_strain: elastic_strain?, tangent: tangent?, history: history? })
}

/// A law that the interpreter evaluates. It is called from the thread of the analysis while the interpreter's thread
/// waits.
#[derive(Clone)]
struct PythonLaw {
    facts: Facts,
    adapter: Arc<Py<PyAny>>,
    calls: Calls,
}

impl fmt::Debug for PythonLaw {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("PythonLaw").field("facts", &self.facts).finish_non_exhaustive()
    }
}

impl PythonLaw {
    /// Holds the interpreter lock during a call; an exception is kept, and its message is returned.
    fn with_interpreter<T>(&self, call: impl FnOnce(Python<'_>) -> PyResult<T>) -> Result<T, String> {
        if self.calls.are_over.load(Ordering::SeqCst) {
            return Err("the interpreter has ended".to_owned());
        }
        Python::attach(|py| {
            call(py).map_err(|error| {
                let message = error.to_string();
                if let Ok(mut raised) = self.calls.raised.lock() {
                    raised.get_or_insert(error);
                }
                message
            })
        })
    }
}

impl Material for PythonLaw {
    fn state_fields(&self) -> &[StateField] {
        &self.facts.fields
    }

    fn strain_measure(&self) -> StrainMeasure {
        self.facts.measure
    }

    fn update(&self, trial: &Sym3, old: &[f64], new: &mut [f64]) -> Result<Response, MaterialError> {
        respond_alone(self, trial, old, new)
    }

    fn elastic_strain(&self, tau: &Sym3, _: &[f64]) -> Result<Sym3, MaterialError> {
        let inverse = self.with_interpreter(|py| {
            let stress = PyArray1::from_slice(py, &row(tau)).reshape([1, 6])?;
            let found: Option<PyReadonlyArrayDyn<'_, f64>> =
                self.adapter.call_method1(py, "invert", (stress,))?.extract(py)?;
            found.map(|strain| Ok(tensor(strain.as_slice()?))).transpose()
        });
        match inverse {
            Ok(Some(strain)) if strain.norm().is_finite() => Ok(strain),
            Ok(Some(_)) => Err(MaterialError::NoStrain),
            Ok(None) => Err(MaterialError::NoInverse),
            Err(_) => Err(MaterialError::Failed),
        }
    }

    fn batch(&self) -> Option<&dyn BatchLaw> {
        Some(self)
    }

    fn energy(&self, elastic_strain: &Sym3, history: &[f64]) -> f64 {
        self.energies(std::slice::from_ref(elastic_strain), history, &[1.0])[0]
    }

    /// The plastic work that the law states; the adapter takes it to be zero if the law does not state it.
    fn plastic_work(&self, history: &[f64]) -> f64 {
        let asked = |py: Python<'_>| {
            let history = PyArray1::from_slice(py, history).reshape([1, history.len()])?;
            let work: PyReadonlyArrayDyn<'_, f64> =
                self.adapter.call_method1(py, "plastic_work", (history,))?.extract(py)?;
            Ok(work.as_slice()?[0])
        };
        // NaN plastic work ends the run.
        self.with_interpreter(asked).unwrap_or(f64::NAN)
    }

    fn tangent_is_symmetric(&self) -> bool {
        self.facts.is_symmetric
    }
}

impl BatchLaw for PythonLaw {
    fn respond(
        &self,
        trial: &[Sym3],
        old: &[f64],
        new: &mut [f64],
        responses: &mut [Response],
    ) -> Result<(), BatchError> {
        let failed = |message: String| BatchError::Failed { point: None, message };
        let strain: &[f64] = &trial.iter().flat_map(row).collect::<Vec<_>>();
        let Answer { stress, elastic_strain, tangent, history } =
            self.with_interpreter(|py| call(py, &self.adapter, strain, old)).map_err(failed)?;
        if [stress.len(), elastic_strain.len(), tangent.len(), history.len()]
            != [6 * trial.len(), 6 * trial.len(), 36 * trial.len(), new.len()]
        {
            return Err(failed("the lengths of its arrays do not match the number of points".to_owned()));
        }
        new.copy_from_slice(&history);
        for (p, response) in responses.iter_mut().enumerate() {
            let point_tangent = &tangent[36 * p..36 * (p + 1)];
            let mut matrix = Tangent::zeros();
            for i in 0..6 {
                for j in 0..6 {
                    matrix[(PLACE[i], PLACE[j])] = point_tangent[6 * i + j];
                }
            }
            *response = Response {
                tau: tensor(&stress[6 * p..6 * (p + 1)]),
                elastic_strain: tensor(&elastic_strain[6 * p..6 * (p + 1)]),
                tangent: matrix,
            };
        }
        Ok(())
    }

    fn energies(&self, elastic_strain: &[Sym3], history: &[f64], volume: &[f64]) -> [f64; 2] {
        let strain: &[f64] = &elastic_strain.iter().flat_map(row).collect::<Vec<_>>();
        match self.with_interpreter(|py| call_energies(py, &self.adapter, strain, history)) {
            Ok(energies) => energies.map(|energy| energy.iter().zip(volume).map(|(e, v)| e * v).sum()),
            // NaN energies end the run.
            Err(_) => [f64::NAN; 2],
        }
    }
}

/// Asks an adapter for the stored energy and the plastic work of each point, per unit initial volume.
fn call_energies(
    py: Python<'_>,
    adapter: &Py<PyAny>,
    strain: &[f64],
    history: &[f64],
) -> PyResult<[Vec<f64>; 2]> {
    let found = adapter.call_method1(py, "energies", <(_, _)>::from(rows(py, strain, history)?))?;
    let arrays: [PyReadonlyArrayDyn<'_, f64>; 2] = found.extract(py)?;
    let [stored, plastic] = arrays.map(|array| array.as_slice().map(<[f64]>::to_vec));
    Ok([stored?, plastic?])
}

/// Strains and histories of points as arrays.
fn rows<'py>(py: Python<'py>, strain: &[f64], history: &[f64]) -> PyResult<[Bound<'py, PyArray2<f64>>; 2]> {
    let n = strain.len() / 6;
    let kept = history.len() / n.max(1);
    let strain = PyArray1::from_slice(py, strain).reshape([n, 6])?;
    Ok([strain, PyArray1::from_slice(py, history).reshape([n, kept])?])
}

/// A law of the library.
#[pyclass(frozen, module = "mpm._mpm")]
pub struct BuiltIn {
    /// The material of a deck with this law.
    material: serde_json::Value,
    law: Box<dyn Material>,
}

#[pymethods]
impl BuiltIn {
    /// The law of a material; the material is given as in a deck, as JSON.
    #[new]
    fn new(material: &str) -> PyResult<BuiltIn> {
        let read = || -> Result<BuiltIn, String> {
            let in_words = |error: serde_json::Error| error.to_string();
            let material: serde_json::Value = serde_json::from_str(material).map_err(in_words)?;
            let parsed: MaterialDeck = serde_json::from_value(material.clone()).map_err(in_words)?;
            Ok(BuiltIn { law: parsed.law_alone()?, material })
        };
        Ok(read().map_err(|error| Raised::misuse(format!("the material cannot be used: {error}")))?)
    }

    /// Names, units and initial values of the history variables.
    fn fields(&self) -> Vec<(String, String, f64)> {
        let fields = self.law.state_fields().iter();
        fields.map(|field| (field.name.to_string(), field.unit.to_string(), field.initial)).collect()
    }

    /// True if strains are logarithmic, false if they are ½ (b − I).
    fn is_logarithmic(&self) -> bool {
        self.law.strain_measure() == StrainMeasure::Logarithmic
    }

    /// True if the tangent is symmetric.
    fn is_symmetric(&self) -> bool {
        self.law.tangent_is_symmetric()
    }

    /// Stress, elastic strain, tangent and history of points.
    fn respond<'py>(
        &self,
        py: Python<'py>,
        strain: PyReadonlyArrayDyn<'py, f64>,
        history: PyReadonlyArrayDyn<'py, f64>,
    ) -> PyResult<[Bound<'py, PyAny>; 4]> {
        let (strain, old) = (strain.as_slice()?, history.as_slice()?);
        let kept = self.law.state_fields().len();
        let n = strain.len() / 6;
        if strain.len() != 6 * n || old.len() != kept * n {
            return Err(Raised::misuse(format!("strain must have shape (n, 6), history (n, {kept})")).into());
        }
        let mut new = old.to_vec();
        let (mut stress, mut elastic, mut tangent) = (Vec::new(), Vec::new(), Vec::new());
        for p in 0..n {
            let history = p * kept..(p + 1) * kept;
            let trial = tensor(&strain[6 * p..6 * (p + 1)]);
            let response = self.law.update(&trial, &old[history.clone()], &mut new[history]);
            // A refused strain yields a row that is not finite, as with the laws of users.
            let response = response.unwrap_or(Response {
                tau: Sym3([f64::NAN; 6]),
                elastic_strain: Sym3([f64::NAN; 6]),
                tangent: Tangent::from_element(f64::NAN),
            });
            stress.extend(row(&response.tau));
            elastic.extend(row(&response.elastic_strain));
            tangent.extend(PLACE.iter().flat_map(|i| PLACE.map(|j| response.tangent[(*i, j)])));
        }
        let tangent = PyArray1::from_vec(py, tangent).reshape([n, 6, 6])?.into_any();
        let new = PyArray1::from_vec(py, new).reshape([n, kept])?.into_any();
        Ok([matrix(py, stress, 6)?, matrix(py, elastic, 6)?, tangent, new])
    }

    /// Elastic strain of points with this stress; NaN for points whose stress no elastic strain yields.
    fn elastic_strain<'py>(
        &self,
        py: Python<'py>,
        stress: PyReadonlyArrayDyn<'py, f64>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let initial = self.law.initial_history();
        let strain = |stress: &[f64]| {
            self.law.elastic_strain(&tensor(stress), &initial).map_or([f64::NAN; 6], |e| row(&e))
        };
        matrix(py, stress.as_slice()?.chunks_exact(6).flat_map(strain).collect(), 6)
    }

    /// Stored energy per initial volume of points with this elastic strain.
    fn energy<'py>(
        &self,
        py: Python<'py>,
        strain: PyReadonlyArrayDyn<'py, f64>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let initial = self.law.initial_history();
        let energy = |strain: &[f64]| self.law.energy(&tensor(strain), &initial);
        let energies = strain.as_slice()?.chunks_exact(6).map(energy);
        matrix(py, energies.collect(), 1)
    }

    /// Plastic work per initial volume of points with this history.
    fn plastic_work<'py>(
        &self,
        py: Python<'py>,
        history: PyReadonlyArrayDyn<'py, f64>,
        points: usize,
    ) -> PyResult<Bound<'py, PyAny>> {
        let kept = self.law.state_fields().len();
        let history = history.as_slice()?;
        if history.len() != kept * points {
            return Err(Raised::misuse(format!("history must have shape (n, {kept})")).into());
        }
        let work = (0..points).map(|p| self.law.plastic_work(&history[p * kept..(p + 1) * kept]));
        matrix(py, work.collect(), 1)
    }
}

/// True if the points have a field of this name, which a history variable of a law can therefore not have.
#[pyfunction]
pub fn is_field_of_points(name: &str) -> bool {
    mpm::deck::is_field_of_points(name)
}

/// The name of a property, a strain, the relative error at that strain, and the tolerance.
type Finding = (String, Vec<f64>, f64, f64);

/// The properties that a law lacks. `law` is the adapter that wraps it.
#[pyfunction]
pub fn conformance(law: &Bound<'_, PyAny>, largest: f64) -> PyResult<Vec<Finding>> {
    let adapter = Arc::new(law.clone().unbind());
    let law = PythonLaw { facts: Facts::new(law)?, adapter, calls: Calls::default() };
    let findings = check(&law, largest).into_iter();
    if let Some(raised) = law.calls.raised.lock().ok().and_then(|mut raised| raised.take()) {
        return Err(raised);
    }
    Ok(findings
        .map(|found| {
            (format!("{:?}", found.property), row(&found.strain).to_vec(), found.error, found.tolerance)
        })
        .collect())
}
