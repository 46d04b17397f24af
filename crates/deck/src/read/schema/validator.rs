//! Validation of a value against a schema.

use boon::{Compiler, Draft, ErrorKind, SchemaIndex, Schemas, ValidationError};
use serde_json::Value;

/// Name of the only schema of a validator.
const NAME: &str = "mpm:schema";

/// A compiled schema, draft 07.
pub struct Validator {
    schemas: Schemas,
    schema: SchemaIndex,
}

impl Validator {
    /// Compiles a schema; `None` if it is not a valid one.
    pub fn new(schema: &Value) -> Option<Validator> {
        let (mut compiler, mut schemas) = (Compiler::new(), Schemas::new());
        compiler.set_default_draft(Draft::V7);
        compiler.add_resource(NAME, schema.clone()).ok()?;
        let schema = compiler.compile(NAME, &mut schemas).ok()?;
        Some(Validator { schemas, schema })
    }

    /// True if a value meets the schema.
    pub fn accepts(&self, value: &Value) -> bool {
        self.schemas.validate(value, self.schema).is_ok()
    }

    /// All faults of a value.
    pub(crate) fn faults<'a>(&'a self, value: &'a Value) -> Vec<Fault<'a>> {
        let mut faults = Vec::new();
        if let Err(error) = self.schemas.validate(value, self.schema) {
            collect(error, value, &mut faults);
        }
        faults
    }
}

/// A value that does not meet a keyword of a schema.
pub(crate) struct Fault<'a> {
    /// Pointer to the value.
    pub pointer: String,
    pub value: &'a Value,
    /// Pointer to the part of the schema that has the keyword. It is part of a URL, but the keys of decks contain no
    /// characters that URLs write otherwise.
    pub path: &'a str,
    pub kind: ErrorKind<'a, 'a>,
    /// If no choice of `anyOf` fits: the faults for each choice. Schemas of decks have no `oneOf`.
    pub choices: Vec<Vec<Fault<'a>>>,
}

/// Collects the faults that an error consists of.
fn collect<'a>(error: ValidationError<'a, 'a>, root: &'a Value, faults: &mut Vec<Fault<'a>>) {
    let ValidationError { schema_url, instance_location, kind, causes } = error;
    let is_choice = matches!(kind, ErrorKind::AnyOf);
    if !causes.is_empty() && !is_choice {
        causes.into_iter().for_each(|cause| collect(cause, root, faults));
        return;
    }
    let choice = |cause| {
        let mut faults = Vec::new();
        collect(cause, root, &mut faults);
        faults
    };
    let pointer = instance_location.to_string();
    faults.push(Fault {
        value: root.pointer(&pointer).unwrap_or(&Value::Null),
        pointer,
        path: schema_url.split_once('#').map_or("", |(_, path)| path),
        kind,
        choices: causes.into_iter().map(choice).collect(),
    });
}
