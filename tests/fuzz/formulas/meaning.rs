//! The meaning of the operators and functions of formulas, and a second parser: written straight from the grammar,
//! without regard to speed, and sharing nothing with the program's own parser.
//!
//! ```text
//! comparison = sum [("<" | "<=" | ">" | ">=" | "==" | "!=") sum]
//! sum        = product {("+" | "-") product}
//! product    = sign {("*" | "/") sign}
//! sign       = ("+" | "-") sign | power
//! power      = atom ["^" sign]
//! atom       = number | name | function "(" comparison {"," comparison} ")" | "(" comparison ")"
//! ```

use super::trees::{CONSTANT, VARIABLES};

/// Stands for two or more arguments.
pub const TWO_OR_MORE: usize = usize::MAX;

/// All functions, each with its number of arguments.
pub const FUNCTIONS: [(&str, usize); 26] = [
    ("abs", 1),
    ("sqrt", 1),
    ("exp", 1),
    ("ln", 1),
    ("log10", 1),
    ("sin", 1),
    ("cos", 1),
    ("tan", 1),
    ("asin", 1),
    ("acos", 1),
    ("atan", 1),
    ("atan2", 2),
    ("sinh", 1),
    ("cosh", 1),
    ("tanh", 1),
    ("asinh", 1),
    ("acosh", 1),
    ("atanh", 1),
    ("floor", 1),
    ("ceil", 1),
    ("sign", 1),
    ("pow", 2),
    ("hypot", 2),
    ("min", TWO_OR_MORE),
    ("max", TWO_OR_MORE),
    ("if", 3),
];

/// The value of an operator between two numbers.
pub fn binary(operator: &str, a: f64, b: f64) -> f64 {
    let holds = match operator {
        "+" => return a + b,
        "-" => return a - b,
        "*" => return a * b,
        "/" => return a / b,
        // NaN stays NaN.
        "^" | "<" | "<=" | ">" | ">=" | "==" | "!=" if a.is_nan() || b.is_nan() => return f64::NAN,
        "^" if b.fract() == 0.0 && (-16.0..=16.0).contains(&b) => return a.powi(b as i32),
        "^" => return a.powf(b),
        "<" => a < b,
        "<=" => a <= b,
        ">" => a > b,
        ">=" => a >= b,
        "==" => a == b,
        _ => a != b,
    };
    if holds { 1.0 } else { 0.0 }
}

/// The value of a function; `None` if no function of this name takes this number of arguments.
pub fn call(name: &str, arguments: &[f64]) -> Option<f64> {
    let (_, count) = FUNCTIONS.iter().find(|(function, _)| *function == name)?;
    let suits = if *count == TWO_OR_MORE { arguments.len() >= 2 } else { arguments.len() == *count };
    if !suits {
        return None;
    }
    let a = arguments[0];
    // The first argument that is NaN decides.
    let undefined = arguments.iter().find(|a| a.is_nan());
    Some(match name {
        "abs" => a.abs(),
        "sqrt" => a.sqrt(),
        "exp" => a.exp(),
        "ln" => a.ln(),
        "log10" => a.log10(),
        "sin" => a.sin(),
        "cos" => a.cos(),
        "tan" => a.tan(),
        "asin" => a.asin(),
        "acos" => a.acos(),
        "atan" => a.atan(),
        "sinh" => a.sinh(),
        "cosh" => a.cosh(),
        "tanh" => a.tanh(),
        "asinh" => a.asinh(),
        "acosh" => a.acosh(),
        "atanh" => a.atanh(),
        "floor" => a.floor(),
        "ceil" => a.ceil(),
        "sign" if a > 0.0 => 1.0,
        "sign" if a < 0.0 => -1.0,
        "sign" => a.abs(),
        "atan2" => a.atan2(arguments[1]),
        "pow" => binary("^", a, arguments[1]),
        "hypot" => a.hypot(arguments[1]),
        "min" | "max" if undefined.is_some() => f64::NAN,
        // The last of 0 and -0, which are equal.
        "min" => arguments.iter().copied().fold(f64::INFINITY, |least, a| if a <= least { a } else { least }),
        "max" => {
            arguments.iter().copied().fold(f64::NEG_INFINITY, |most, a| if a >= most { a } else { most })
        }
        _ if a.is_nan() => a,
        _ if a == 0.0 => arguments[2],
        _ => arguments[1],
    })
}

/// The value of a formula; `None` if the text is not a formula.
pub fn value(text: &str, variables: &[f64; 2]) -> Option<f64> {
    let tokens = tokens(text)?;
    let mut reader = Reader { tokens: &tokens, at: 0, variables };
    let value = reader.comparison()?;
    (reader.at == tokens.len()).then_some(value)
}

/// Divides a text into numbers, names and symbols; `None` if a character belongs to none of them.
fn tokens(text: &str) -> Option<Vec<String>> {
    let chars: Vec<char> = text.chars().collect();
    let mut tokens = Vec::new();
    let mut at = 0;
    while at < chars.len() {
        let start = at;
        let is = |k: usize, test: fn(&char) -> bool| chars.get(k).is_some_and(test);
        let digit = |k: usize| is(k, char::is_ascii_digit);
        if chars[at].is_whitespace() {
            at += 1;
            continue;
        }
        if digit(at) || (chars[at] == '.' && digit(at + 1)) {
            while digit(at) {
                at += 1;
            }
            if chars.get(at) == Some(&'.') {
                at += 1;
                while digit(at) {
                    at += 1;
                }
            }
            if is(at, |c| matches!(c, 'e' | 'E')) {
                let sign = usize::from(is(at + 1, |c| matches!(c, '+' | '-')));
                if digit(at + 1 + sign) {
                    at += 1 + sign;
                    while digit(at) {
                        at += 1;
                    }
                }
            }
        } else if chars[at].is_alphabetic() || chars[at] == '_' {
            while is(at, |c| c.is_alphanumeric() || *c == '_') {
                at += 1;
            }
        } else {
            let two: String = chars[at..(at + 2).min(chars.len())].iter().collect();
            at += match two.as_str() {
                "**" => return None,
                "<=" | ">=" | "==" | "!=" => 2,
                _ if "<>+-*/^(),".contains(chars[at]) => 1,
                _ => return None,
            };
        }
        tokens.push(chars[start..at].iter().collect());
    }
    Some(tokens)
}

struct Reader<'a> {
    tokens: &'a [String],
    at: usize,
    variables: &'a [f64; 2],
}

impl Reader<'_> {
    /// Takes the next token if it is one of these.
    fn take(&mut self, wanted: &[&str]) -> Option<String> {
        let token = self.tokens.get(self.at).filter(|token| wanted.contains(&token.as_str()))?;
        self.at += 1;
        Some(token.clone())
    }

    fn comparison(&mut self) -> Option<f64> {
        let a = self.sum()?;
        match self.take(&["<", "<=", ">", ">=", "==", "!="]) {
            Some(operator) => Some(binary(&operator, a, self.sum()?)),
            None => Some(a),
        }
    }

    fn sum(&mut self) -> Option<f64> {
        let mut a = self.product()?;
        while let Some(operator) = self.take(&["+", "-"]) {
            a = binary(&operator, a, self.product()?);
        }
        Some(a)
    }

    fn product(&mut self) -> Option<f64> {
        let mut a = self.sign()?;
        while let Some(operator) = self.take(&["*", "/"]) {
            a = binary(&operator, a, self.sign()?);
        }
        Some(a)
    }

    fn sign(&mut self) -> Option<f64> {
        match self.take(&["+", "-"]).as_deref() {
            Some("-") => Some(-self.sign()?),
            Some(_) => self.sign(),
            None => self.power(),
        }
    }

    fn power(&mut self) -> Option<f64> {
        let base = self.atom()?;
        match self.take(&["^"]) {
            Some(_) => Some(binary("^", base, self.sign()?)),
            None => Some(base),
        }
    }

    fn atom(&mut self) -> Option<f64> {
        let token = self.tokens.get(self.at)?.clone();
        self.at += 1;
        if token == "(" {
            let inner = self.comparison()?;
            return self.take(&[")"]).map(|_| inner);
        }
        if token.starts_with(|c: char| c.is_ascii_digit() || c == '.') {
            return token.parse::<f64>().ok().filter(|value| value.is_finite());
        }
        if self.take(&["("]).is_some() {
            let mut arguments = vec![self.comparison()?];
            while self.take(&[","]).is_some() {
                arguments.push(self.comparison()?);
            }
            self.take(&[")"])?;
            return call(&token, &arguments);
        }
        if let Some(number) = VARIABLES.iter().position(|variable| *variable == token) {
            return Some(self.variables[number]);
        }
        match token.as_str() {
            name if name == CONSTANT.0 => Some(CONSTANT.1),
            "pi" => Some(std::f64::consts::PI),
            _ => None,
        }
    }
}
