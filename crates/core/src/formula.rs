//! Formulas written as text in a deck, such as `gamma*y` or `if(x < 1, 0, sin(pi*x))`.
//!
//! A Pratt parser compiles the text to postfix code, which runs on a stack of fixed size: evaluation never allocates
//! and never fails. The language has numbers, names, `+ - * / ^`, comparisons (1 if true, 0 if false) and the usual
//! functions. `^` binds tighter than a leading sign and is right associative: `-x^2` is `-(x^2)` and `2^3^2` is 512.

mod error;
mod functions;
mod parser;
mod spelling;

use functions::{Op, STACK, function};
use parser::{Parser, number_length};

pub use error::FormulaError;
pub use spelling::closest;

/// Largest number of intermediate values in a formula.
pub const MAX_INTERMEDIATE: usize = 64;
/// Largest number of variables besides the intermediate values: two positions in space and the load factor.
const MAX_GIVEN: usize = 7;

/// A compiled formula.
#[derive(Debug, Clone)]
pub struct Formula {
    text: String,
    code: Vec<Op>,
    variables: usize,
    /// Formulas of the intermediate values, which are the variables after the given ones; each may use all variables
    /// before it.
    intermediate: Vec<Formula>,
}

impl Formula {
    /// Parses a formula in the given variables; [`Formula::evaluate`] takes their values in the same order.
    ///
    /// # Errors
    /// The first error in the text, with its location.
    pub fn parse(text: &str, variables: &[&str]) -> Result<Formula, FormulaError> {
        Formula::parse_with_constants(text, variables, &[])
    }

    /// Parses a formula in the given variables, with additional names for constants.
    ///
    /// # Errors
    /// The first error in the text, with its location.
    pub fn parse_with_constants(
        text: &str,
        variables: &[&str],
        constants: &[(&str, f64)],
    ) -> Result<Formula, FormulaError> {
        let code = Parser::new(text, variables, constants).parse()?;
        Ok(Formula { text: text.to_owned(), code, variables: variables.len(), intermediate: Vec::new() })
    }

    /// A formula with a constant value.
    pub fn constant(value: f64) -> Formula {
        let code = vec![Op::Constant(value)];
        Formula { text: value.to_string(), code, variables: 0, intermediate: Vec::new() }
    }

    /// Defines the last variables of the formula as intermediate values, each given by a formula in the variables
    /// before it. The formula can use at most [`MAX_INTERMEDIATE`] intermediate values and 7 other variables.
    pub fn with_intermediate(mut self, intermediate: &[Formula]) -> Formula {
        let used = intermediate.len().min(MAX_INTERMEDIATE);
        if self.code.iter().any(|op| matches!(op, Op::Variable(_))) {
            self.variables = self.variables.saturating_sub(used).min(MAX_GIVEN);
            self.intermediate = intermediate[..used].to_vec();
        }
        self
    }

    /// The source text.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The value of a formula that depends on no variable; `None` for any other formula.
    pub fn as_constant(&self) -> Option<f64> {
        let depends = self.code.iter().any(|op| matches!(op, Op::Variable(_)));
        (!depends).then(|| self.evaluate(&[]))
    }

    /// True if the formula depends on variable number `variable`, directly or through an intermediate value.
    pub fn depends_on(&self, variable: usize) -> bool {
        let uses = |formula: &Formula, variable: usize| {
            formula.code.iter().any(|op| matches!(op, Op::Variable(index) if *index == variable))
        };
        let mut depend: Vec<usize> = vec![variable];
        for (number, formula) in (self.variables..).zip(&self.intermediate) {
            if depend.iter().any(|&known| uses(formula, known)) {
                depend.push(number);
            }
        }
        depend.iter().any(|&known| uses(self, known))
    }

    /// Evaluates the formula; a variable without a value counts as NaN.
    pub fn evaluate(&self, values: &[f64]) -> f64 {
        debug_assert!(
            self.variables <= values.len() || !self.code.iter().any(|op| matches!(op, Op::Variable(_)))
        );
        if self.intermediate.is_empty() {
            return self.run(values);
        }
        let mut all = [f64::NAN; MAX_GIVEN + MAX_INTERMEDIATE];
        let given = values.len().min(self.variables);
        all[..given].copy_from_slice(&values[..given]);
        let mut known = self.variables;
        for formula in &self.intermediate {
            all[known] = formula.run(&all[..known]);
            known += 1;
        }
        self.run(&all[..known])
    }

    /// Runs the code of the formula, without its intermediate values.
    fn run(&self, values: &[f64]) -> f64 {
        let mut stack = [0.0; STACK];
        let mut top = 0;
        for op in &self.code {
            match *op {
                Op::Constant(value) => {
                    stack[top] = value;
                    top += 1;
                }
                Op::Variable(index) => {
                    stack[top] = values.get(index).copied().unwrap_or(f64::NAN);
                    top += 1;
                }
                Op::One(f) => stack[top - 1] = f(stack[top - 1]),
                Op::Two(f) => {
                    top -= 1;
                    stack[top - 1] = f(stack[top - 1], stack[top]);
                }
                Op::Select => {
                    top -= 2;
                    let condition = stack[top - 1];
                    stack[top - 1] = if condition.is_nan() {
                        condition
                    } else if condition != 0.0 {
                        stack[top]
                    } else {
                        stack[top + 1]
                    };
                }
            }
        }
        stack[0]
    }
}

/// True if `name` is reserved in formulas: a function or the constant `pi`.
pub fn is_reserved(name: &str) -> bool {
    name == "pi" || function(name).is_some()
}

/// The names in a formula, each with its byte offset. Syntax errors are ignored; the parser reports them.
pub fn names(text: &str) -> Vec<(usize, &str)> {
    let mut found = Vec::new();
    let mut at = 0;
    while let Some(first) = text[at..].chars().next() {
        let rest = &text[at..];
        let length = if first.is_ascii_digit() {
            number_length(rest)
        } else if first.is_alphabetic() || first == '_' {
            let end = rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len());
            found.push((at, &rest[..end]));
            end
        } else {
            first.len_utf8()
        };
        at += length;
    }
    found
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::formula::functions::FUNCTIONS;
    use proptest::prelude::*;

    fn value(text: &str) -> f64 {
        Formula::parse(text, &["x", "y"]).unwrap().evaluate(&[2.0, 3.0])
    }

    fn fault(text: &str) -> FormulaError {
        Formula::parse(text, &["x", "y", "gamma"]).unwrap_err()
    }

    #[test]
    fn words_are_suggested_only_where_they_are_close() {
        let keys = ["model", "young", "poisson", "density", "deviatoric_yield_stress", "hardening_modulus"];
        for (written, meant) in [
            ("yuong", "young"),
            ("poison", "poisson"),
            ("posson", "poisson"),
            ("densty", "density"),
            ("Density", "density"),
            ("modle", "model"),
            ("poisson_ratio", "poisson"),
            ("youngs_modulus", "young"),
            ("hardning_moduls", "hardening_modulus"),
            ("deviatoric_yield_stres", "deviatoric_yield_stress"),
        ] {
            assert_eq!(closest(written, keys), Some(meant), "{written}");
        }
        for foreign in [
            "porosity",
            "cohesion",
            "friction_angle",
            "thickness",
            "permeability",
            "dilatancy",
            "bulk",
            "shear",
            "viscosity",
            "identity",
            "tension",
            "E",
            "nu",
            "rho",
            "",
        ] {
            assert_eq!(closest(foreign, keys), None, "{foreign}");
        }
        assert_eq!(closest("stress", ["steps", "solver", "grid"]), None);
        assert_eq!(closest("tol", ["tolerance", "linear"]), Some("tolerance"));
        assert_eq!(closest("hh", ["n", "h"]), Some("h"));
        assert_eq!(closest("ux", ["uy", "uz"]), None, "another key, not a slip");
    }

    #[test]
    fn arithmetic_follows_the_usual_rules() {
        for (text, expected) in [
            ("-x^2", -4.0),
            ("2^3^2", 512.0),
            ("2^-1", 0.5),
            ("2^-x^2", 0.0625),
            ("-2^-2", -0.25),
            ("1-2-3", -4.0),
            ("8/4/2", 1.0),
            ("1e-3*x", 2e-3),
            (".5 + 1.", 1.5),
            ("2*-x", -4.0),
            ("+x - -y", 5.0),
            ("1 + 2 < 4", 1.0),
            ("x >= y", 0.0),
            ("x != y", 1.0),
            ("(1 < 2) == 1", 1.0),
            ("if(x < y, 10, 1/0)", 10.0),
            ("min(x, y, -1)", -1.0),
            ("max(1, x, y, 2)", 3.0),
            ("atan2(1, 1) - pi/4", 0.0),
            ("hypot(x + 1, y + 1)", 5.0),
            ("pow(x, y)", 8.0),
            ("sign(-3) + sign(0)", -1.0),
            ("ln(exp(2)) + log10(100)", 4.0),
            ("floor(2.5) + ceil(2.5)", 5.0),
        ] {
            assert!((value(text) - expected).abs() < 1e-14, "{text} = {}", value(text));
        }
    }

    #[test]
    fn faults_have_exact_places() {
        for (text, offset, length, message) in [
            ("", 0, 0, "the formula ends where a number or a name is expected"),
            ("1 +", 3, 0, "the formula ends where a number or a name is expected"),
            ("2*gama", 2, 4, "unknown name `gama`"),
            ("2 $ 3", 2, 1, "unexpected character `$`"),
            ("ü+1", 0, 2, "unknown name `ü`"),
            ("(1+2", 0, 1, "this parenthesis is never closed"),
            ("sin(1, 2)", 0, 9, "`sin` takes 1 argument, 2 given"),
            ("min(1)", 0, 6, "`min` takes 2 or more arguments, 1 given"),
            ("sin", 0, 3, "the function `sin` needs its arguments"),
            ("2 x", 2, 1, "expected an operator, found `x`"),
            ("x(2)", 0, 1, "`x` is not a function"),
            ("1 < 2 < 3", 6, 1, "comparisons cannot be chained"),
            ("x**2", 1, 2, "unknown operator `**`"),
            ("1e999", 0, 5, "this number is too large"),
            ("sqr(2)", 0, 3, "unknown function `sqr`"),
        ] {
            let found = fault(text);
            assert_eq!(
                (found.message.as_str(), found.offset, found.length),
                (message, offset, length),
                "{text}"
            );
        }
        assert_eq!(fault("2*gama").help.as_deref(), Some("did you mean `gamma`?"));
        assert_eq!(fault("sqr(2)").help.as_deref(), Some("did you mean `sqrt`?"));
    }

    #[test]
    fn intermediate_values_stand_for_formulas() {
        let square = Formula::parse("x^2", &["x", "f"]).unwrap();
        let scaled = Formula::parse("f*a", &["x", "f", "a"]).unwrap();
        let given = [square, scaled];
        let formula =
            |text: &str| Formula::parse(text, &["x", "f", "a", "b"]).unwrap().with_intermediate(&given);
        assert_eq!(formula("a + b + x").evaluate(&[3.0, 2.0]), 9.0 + 18.0 + 3.0);
        assert!(formula("b").depends_on(1) && formula("b").depends_on(0));
        assert!(formula("a").depends_on(0) && !formula("a").depends_on(1));
        assert_eq!(formula("7").as_constant(), Some(7.0));
        assert_eq!(formula("a").as_constant(), None);
    }

    #[test]
    fn what_is_undefined_stays_so() {
        for text in [
            "if(sqrt(-x) > 0, 1, 2)",
            "sqrt(-x) != 1",
            "sqrt(-x)^0",
            "1^sqrt(-x)",
            "min(1, sqrt(-x))",
            "max(sqrt(-x), 1)",
            "sign(sqrt(-x))",
        ] {
            assert!(value(text).is_nan(), "{text} = {}", value(text));
        }
    }

    #[test]
    fn depth_is_bounded() {
        for text in ["(".repeat(10_000), "-".repeat(10_000), "2^".repeat(10_000), "min(1,".repeat(10_000)] {
            assert!(fault(&text).message.contains("nested too deeply"));
        }
        let sum = vec!["x"; 10_000].join("+");
        assert_eq!(value(&sum), 20_000.0);
    }

    #[test]
    fn names_may_stand_for_numbers() {
        let formula = Formula::parse_with_constants("g*y", &["x", "y"], &[("g", -2.0)]).unwrap();
        assert_eq!(formula.evaluate(&[0.0, 3.0]), -6.0);
        assert_eq!(formula.as_constant(), None);
        assert_eq!(Formula::constant(4.0).evaluate(&[]), 4.0);
        assert_eq!(Formula::parse("2*pi", &["x"]).unwrap().as_constant(), Some(std::f64::consts::TAU));
    }

    #[test]
    fn every_listed_function_exists() {
        assert!(FUNCTIONS.into_iter().all(|name| function(name).is_some()));
        assert_eq!(names("2e3*ab+sin(c.1)"), [(4, "ab"), (7, "sin"), (11, "c")]);
    }

    proptest! {
        #[test]
        fn no_text_makes_the_parser_panic(text in "\\PC*") {
            let _ = Formula::parse(&text, &["x"]).map(|formula| formula.evaluate(&[0.5]));
            prop_assert!(names(&text).into_iter().all(|(at, name)| text[at..].starts_with(name)));
        }

        #[test]
        fn no_soup_of_tokens_makes_the_parser_panic(
            tokens in prop::collection::vec(
                prop::sample::select(vec!["x", "1", "1e", ".", "(", ")", ",", "+", "-", "^", "<", "if", "min", "é", " "]),
                0..60,
            )
        ) {
            let text = tokens.concat();
            match Formula::parse(&text, &["x"]) {
                Ok(formula) => { formula.evaluate(&[0.5]); }
                Err(error) => prop_assert!(text.get(error.offset..error.offset + error.length).is_some()),
            }
        }
    }
}
