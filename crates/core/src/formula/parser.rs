//! The parser of formulas: compiles text to postfix code.

use super::error::FormulaError;
use super::functions::{Binary, FUNCTIONS, Function, Op, STACK, function, power, truth};
use super::spelling::closest;

/// Deepest nesting of expressions: parentheses, arguments, signs and right operands.
const MAX_NESTING: usize = 64;
const NESTED: &str = "the formula is nested too deeply";
const FLATTEN: &str = "use fewer parentheses, or define intermediate values under `where`";

#[derive(Debug, Clone, Copy, PartialEq)]
enum Token {
    Number(f64, usize),
    /// A name, given by its length, [byte].
    Name(usize),
    /// An operator or parenthesis.
    Symbol(&'static str),
}

const SYMBOLS: [&str; 15] = ["<=", ">=", "==", "!=", "**", "<", ">", "+", "-", "*", "/", "^", "(", ")", ","];

/// Precedence and operation of a binary operator: comparison, sum, product, power. A sign ranks between product and
/// power.
fn strength(symbol: &str) -> Option<(u8, Binary)> {
    Some(match symbol {
        "<" => (1, |a, b| truth(a < b, a, b)),
        "<=" => (1, |a, b| truth(a <= b, a, b)),
        ">" => (1, |a, b| truth(a > b, a, b)),
        ">=" => (1, |a, b| truth(a >= b, a, b)),
        "==" => (1, |a, b| truth(a == b, a, b)),
        "!=" => (1, |a, b| truth(a != b, a, b)),
        "+" => (2, |a, b| a + b),
        "-" => (2, |a, b| a - b),
        "*" => (3, |a, b| a * b),
        "/" => (3, |a, b| a / b),
        "^" => (5, power),
        _ => return None,
    })
}

const SIGN: u8 = 4;

pub(super) struct Parser<'a> {
    text: &'a str,
    at: usize,
    variables: &'a [&'a str],
    constants: &'a [(&'a str, f64)],
    code: Vec<Op>,
    height: usize,
    nesting: usize,
}

impl<'a> Parser<'a> {
    pub(super) fn new(
        text: &'a str,
        variables: &'a [&'a str],
        constants: &'a [(&'a str, f64)],
    ) -> Parser<'a> {
        Parser { text, at: 0, variables, constants, code: Vec::new(), height: 0, nesting: 0 }
    }

    /// Compiles the whole text.
    pub(super) fn parse(mut self) -> Result<Vec<Op>, FormulaError> {
        self.expression(0)?;
        if let Some((start, token)) = self.peek()? {
            let end = self.end_of(start, &token);
            let message = format!("expected an operator, found `{}`", &self.text[start..end]);
            let help = "write `*` for a product, `,` between arguments, and a closing parenthesis for each opening one";
            return Err(self.fault(start, end - start, message, help));
        }
        Ok(self.code)
    }

    fn fault(
        &self,
        offset: usize,
        length: usize,
        message: impl Into<String>,
        help: impl Into<String>,
    ) -> FormulaError {
        FormulaError { message: message.into(), offset, length, help: Some(help.into()) }
    }

    /// The next token and its offset, without consuming it.
    fn peek(&mut self) -> Result<Option<(usize, Token)>, FormulaError> {
        let rest = &self.text[self.at..];
        self.at += rest.len() - rest.trim_start().len();
        let start = self.at;
        let rest = &self.text[start..];
        let Some(first) = rest.chars().next() else { return Ok(None) };
        if first.is_ascii_digit() || (first == '.' && rest[1..].starts_with(|c: char| c.is_ascii_digit())) {
            let length = number_length(rest);
            let value: f64 = rest[..length].parse().unwrap_or(f64::NAN);
            if !value.is_finite() {
                return Err(self.fault(start, length, "this number is too large", "write one below 1.8e308"));
            }
            return Ok(Some((start, Token::Number(value, length))));
        }
        if first.is_alphabetic() || first == '_' {
            let end = rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len());
            return Ok(Some((start, Token::Name(end))));
        }
        let Some(symbol) = SYMBOLS.into_iter().find(|symbol| rest.starts_with(symbol)) else {
            let help = format!("remove it; the operators are {}", "+ - * / ^ < <= > >= == !=");
            let message = format!("unexpected character `{first}`");
            return Err(self.fault(start, first.len_utf8(), message, help));
        };
        if symbol == "**" {
            return Err(self.fault(start, 2, "unknown operator `**`", "a power is written `^`"));
        }
        Ok(Some((start, Token::Symbol(symbol))))
    }

    fn end_of(&self, start: usize, token: &Token) -> usize {
        start
            + match token {
                Token::Number(_, length) | Token::Name(length) => *length,
                Token::Symbol(symbol) => symbol.len(),
            }
    }

    fn peek_symbol(&mut self) -> Result<Option<&'static str>, FormulaError> {
        Ok(self.peek()?.and_then(|(_, token)| match token {
            Token::Symbol(symbol) => Some(symbol),
            _ => None,
        }))
    }

    fn emit(&mut self, op: Op) -> Result<(), FormulaError> {
        self.height = match op {
            Op::Constant(_) | Op::Variable(_) => self.height + 1,
            Op::One(_) => self.height,
            Op::Two(_) => self.height - 1,
            Op::Select => self.height - 2,
        };
        if self.height > STACK {
            return Err(self.fault(0, self.text.len(), NESTED, FLATTEN));
        }
        self.code.push(op);
        Ok(())
    }

    /// Parses an expression whose operators have a precedence above `floor`.
    fn expression(&mut self, floor: u8) -> Result<(), FormulaError> {
        self.nesting += 1;
        if self.nesting > MAX_NESTING {
            return Err(self.fault(self.at, 0, NESTED, FLATTEN));
        }
        self.operand()?;
        let mut compared = false;
        while let Some((start, Token::Symbol(symbol))) = self.peek()? {
            let Some((level, operation)) = strength(symbol) else { break };
            if level <= floor {
                break;
            }
            if level == 1 && std::mem::replace(&mut compared, true) {
                let help = "multiply two comparisons, `(a < b)*(b < c)`";
                return Err(self.fault(start, symbol.len(), "comparisons cannot be chained", help));
            }
            self.at = start + symbol.len();
            // A power is right associative: its exponent may contain signs and further powers.
            self.expression(if level == 5 { SIGN } else { level })?;
            self.emit(Op::Two(operation))?;
        }
        self.nesting -= 1;
        Ok(())
    }

    fn operand(&mut self) -> Result<(), FormulaError> {
        let Some((start, token)) = self.peek()? else {
            let message = "the formula ends where a number or a name is expected";
            return Err(self.fault(self.at, 0, message, "complete it, or remove the operator at its end"));
        };
        self.at = self.end_of(start, &token);
        match token {
            Token::Number(value, _) => self.emit(Op::Constant(value)),
            Token::Name(length) => self.name(start, length),
            Token::Symbol("(") => {
                self.expression(0)?;
                self.expect(")", start)
            }
            Token::Symbol("-") => {
                self.expression(SIGN)?;
                self.emit(Op::One(|x| -x))
            }
            Token::Symbol("+") => self.expression(SIGN),
            Token::Symbol(symbol) => {
                let message = format!("expected a number or a name, found `{symbol}`");
                Err(self.fault(
                    start,
                    symbol.len(),
                    message,
                    "write an operand there, or remove the operator",
                ))
            }
        }
    }

    fn expect(&mut self, symbol: &'static str, opened_at: usize) -> Result<(), FormulaError> {
        match self.peek()? {
            Some((start, Token::Symbol(found))) if found == symbol => {
                self.at = start + symbol.len();
                Ok(())
            }
            Some((start, token)) => {
                let end = self.end_of(start, &token);
                let found = &self.text[start..end];
                let message = format!("expected `{symbol}`, found `{found}`");
                let help = format!("write an operator before it, or `{symbol}` where the parenthesis ends");
                Err(self.fault(start, end - start, message, help))
            }
            None => Err(self.fault(
                opened_at,
                1,
                "this parenthesis is never closed",
                format!("add `{symbol}` at the end of the part in parentheses"),
            )),
        }
    }

    fn name(&mut self, start: usize, length: usize) -> Result<(), FormulaError> {
        let name = &self.text[start..start + length];
        let opens = self.peek_symbol()? == Some("(");
        if let Some(function) = function(name) {
            if !opens {
                let message = format!("the function `{name}` needs its arguments");
                return Err(self.fault(
                    start,
                    length,
                    message,
                    format!("write them in parentheses: `{name}(...)`"),
                ));
            }
            return self.call(start, name, &function);
        }
        let meaning = if let Some(index) = self.variables.iter().position(|variable| *variable == name) {
            Some(Op::Variable(index))
        } else if let Some((_, value)) = self.constants.iter().find(|(constant, _)| *constant == name) {
            Some(Op::Constant(*value))
        } else if name == "pi" {
            Some(Op::Constant(std::f64::consts::PI))
        } else {
            None
        };
        match meaning {
            Some(_) if opens => {
                let message = format!("`{name}` is not a function");
                Err(self.fault(start, length, message, "a product is written with `*`"))
            }
            Some(op) => self.emit(op),
            None => Err(self.unknown_name(start, name, opens)),
        }
    }

    fn unknown_name(&self, start: usize, name: &str, is_call: bool) -> FormulaError {
        let quantities = || {
            let constants = self.constants.iter().map(|(constant, _)| *constant);
            self.variables.iter().copied().chain(constants).chain(["pi"])
        };
        let what = if is_call { "function" } else { "name" };
        let help = if is_call {
            closest(name, FUNCTIONS)
                .map(|best| format!("did you mean `{best}`?"))
                .unwrap_or_else(|| format!("the functions are {}", FUNCTIONS.join(", ")))
        } else {
            closest(name, quantities()).map(|best| format!("did you mean `{best}`?")).unwrap_or_else(|| {
                match &quantities().collect::<Vec<_>>()[..] {
                    [only] => format!("the only name known here is {only}"),
                    names => format!("the names known here are {}", names.join(", ")),
                }
            })
        };
        self.fault(start, name.len(), format!("unknown {what} `{name}`"), help)
    }

    fn call(&mut self, start: usize, name: &str, function: &Function) -> Result<(), FormulaError> {
        let opened_at = self.at;
        self.at += 1;
        let mut arguments = 0;
        if self.peek_symbol()? != Some(")") {
            loop {
                self.expression(0)?;
                arguments += 1;
                if let (Function::Fold(f), true) = (function, arguments > 1) {
                    self.emit(Op::Two(*f))?;
                }
                if self.peek_symbol()? != Some(",") {
                    break;
                }
                self.at += 1;
            }
        }
        self.expect(")", opened_at)?;
        let wrong = |expected: &str| {
            let message = format!("`{name}` takes {expected}, {arguments} given");
            let help = match function {
                Function::One(_) => format!("give {expected}"),
                _ => format!("give {expected}, with `,` between them"),
            };
            self.fault(start, self.at - start, message, help)
        };
        match function {
            Function::One(_) if arguments != 1 => Err(wrong("1 argument")),
            Function::Two(_) if arguments != 2 => Err(wrong("2 arguments")),
            Function::If if arguments != 3 => {
                Err(wrong("3 arguments (condition, value if true, value if false)"))
            }
            Function::Fold(_) if arguments < 2 => Err(wrong("2 or more arguments")),
            Function::One(f) => self.emit(Op::One(*f)),
            Function::Two(f) => self.emit(Op::Two(*f)),
            Function::If => self.emit(Op::Select),
            Function::Fold(_) => Ok(()),
        }
    }
}

/// Length of the number at the start of the text, [byte]. An exponent counts only if it has digits.
pub(super) fn number_length(text: &str) -> usize {
    let bytes = text.as_bytes();
    let digits = |from: usize| bytes[from..].iter().take_while(|byte| byte.is_ascii_digit()).count();
    let mut length = digits(0);
    if bytes.get(length) == Some(&b'.') {
        length += 1;
        length += digits(length);
    }
    if matches!(bytes.get(length), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(bytes.get(length + 1), Some(b'+' | b'-')));
        let exponent = if length + 1 + sign <= bytes.len() { digits(length + 1 + sign) } else { 0 };
        if exponent > 0 {
            length += 1 + sign + exponent;
        }
    }
    length
}
