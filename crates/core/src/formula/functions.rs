//! The instructions of compiled formulas, and the built-in functions.

/// Stack size of the evaluation; the parser refuses formulas that need more.
pub(super) const STACK: usize = 64;

/// An instruction: pops its operands from the stack and pushes its result.
#[derive(Debug, Clone, Copy)]
pub(super) enum Op {
    Constant(f64),
    Variable(usize),
    One(fn(f64) -> f64),
    Two(Binary),
    /// `if(c, a, b)`. Both branches have been evaluated; the branch that is not selected has no effect, even if it is
    /// NaN.
    Select,
}

/// A function of two numbers.
pub(super) type Binary = fn(f64, f64) -> f64;

/// A built-in function.
pub(super) enum Function {
    One(fn(f64) -> f64),
    Two(Binary),
    /// Two or more arguments, combined pairwise from the left.
    Fold(Binary),
    If,
}

pub(super) const FUNCTIONS: [&str; 26] = [
    "abs", "sqrt", "exp", "ln", "log10", "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh",
    "cosh", "tanh", "asinh", "acosh", "atanh", "floor", "ceil", "sign", "pow", "hypot", "min", "max", "if",
];

pub(super) fn function(name: &str) -> Option<Function> {
    Some(match name {
        "abs" => Function::One(f64::abs),
        "sqrt" => Function::One(f64::sqrt),
        "exp" => Function::One(f64::exp),
        "ln" => Function::One(f64::ln),
        "log10" => Function::One(f64::log10),
        "sin" => Function::One(f64::sin),
        "cos" => Function::One(f64::cos),
        "tan" => Function::One(f64::tan),
        "asin" => Function::One(f64::asin),
        "acos" => Function::One(f64::acos),
        "atan" => Function::One(f64::atan),
        "sinh" => Function::One(f64::sinh),
        "cosh" => Function::One(f64::cosh),
        "tanh" => Function::One(f64::tanh),
        "asinh" => Function::One(f64::asinh),
        "acosh" => Function::One(f64::acosh),
        "atanh" => Function::One(f64::atanh),
        "floor" => Function::One(f64::floor),
        "ceil" => Function::One(f64::ceil),
        "sign" => Function::One(sign),
        "atan2" => Function::Two(f64::atan2),
        "pow" => Function::Two(power),
        "hypot" => Function::Two(f64::hypot),
        "min" => Function::Fold(minimum),
        "max" => Function::Fold(maximum),
        "if" => Function::If,
        _ => return None,
    })
}

pub(super) fn sign(x: f64) -> f64 {
    if x == 0.0 { 0.0 } else { x.signum() }
}

// NaN must propagate: `f64::min` would hide a formula that is undefined.
pub(super) fn minimum(a: f64, b: f64) -> f64 {
    if a.is_nan() || a < b { a } else { b }
}

pub(super) fn maximum(a: f64, b: f64) -> f64 {
    if a.is_nan() || a > b { a } else { b }
}

pub(super) fn power(base: f64, exponent: f64) -> f64 {
    // Small integer exponents use repeated multiplication, so that squares are correctly rounded and equal on every
    // platform. NaN propagates even where `powf` would return 1 (`NaN^0`, `1^NaN`).
    if base.is_nan() || exponent.is_nan() {
        f64::NAN
    } else if exponent.abs() <= 16.0 && exponent.fract() == 0.0 {
        base.powi(exponent as i32)
    } else {
        base.powf(exponent)
    }
}

/// A comparison as 1 or 0; NaN if an operand is NaN.
pub(super) fn truth(condition: bool, a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { f64::from(u8::from(condition)) }
}
