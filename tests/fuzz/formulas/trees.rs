//! Random formulas as trees, with a direct evaluation and texts in several spellings.

use super::meaning;
use crate::random::Random;

/// Names that the formulas may use: two variables, by their numbers, and one constant.
pub const VARIABLES: [&str; 2] = ["x", "y"];
pub const CONSTANT: (&str, f64) = ("gamma", 0.5772);

/// A formula.
#[derive(Debug, Clone)]
pub enum Tree {
    /// A number and a spelling of it.
    Number(f64, String),
    Variable(usize),
    Constant,
    Pi,
    Negative(Box<Tree>),
    Positive(Box<Tree>),
    Binary(&'static str, Box<Tree>, Box<Tree>),
    Call(&'static str, Vec<Tree>),
}

const OPERATORS: [&str; 11] = ["+", "-", "*", "/", "^", "<", "<=", ">", ">=", "==", "!="];

impl Tree {
    /// A random formula of at most this many levels.
    pub fn random(random: &mut Random, levels: usize) -> Tree {
        if levels == 0 || random.chance(1.0 / 6.0) {
            return Tree::leaf(random);
        }
        let next = |random: &mut Random| Box::new(Tree::random(random, levels - 1));
        match random.below(8) {
            0 => Tree::Negative(next(random)),
            1 if random.chance(1.0 / 3.0) => Tree::Positive(next(random)),
            1 | 2 => {
                let (name, count) = *random.pick(&meaning::FUNCTIONS);
                let count = if count == meaning::TWO_OR_MORE { 2 + random.below(3) } else { count };
                Tree::Call(name, (0..count).map(|_| *next(random)).collect())
            }
            _ => {
                // Powers more often than other operators, because precedence matters most for them.
                let operator = if random.chance(1.0 / 3.0) { "^" } else { *random.pick(&OPERATORS) };
                Tree::Binary(operator, next(random), next(random))
            }
        }
    }

    fn leaf(random: &mut Random) -> Tree {
        match random.below(8) {
            0 => Tree::Pi,
            1 => Tree::Constant,
            2..=4 => Tree::Variable(random.below(2)),
            _ => {
                let text = match random.below(6) {
                    0 => format!("{}", random.below(5)),
                    1 => format!("{}.", random.below(100)),
                    2 => format!(".{}", random.below(1000)),
                    3 => format!("{}e{}", random.below(10), random.below(30)),
                    4 => format!("{}.{}E-{}", random.below(10), random.below(100), random.below(30)),
                    _ => format!("{:?}", (random.next() >> 11) as f64 / (1u64 << 51) as f64),
                };
                Tree::Number(text.parse().unwrap(), text)
            }
        }
    }

    /// The value, evaluated recursively.
    pub fn value(&self, variables: &[f64; 2]) -> f64 {
        let of = |tree: &Tree| tree.value(variables);
        match self {
            Tree::Number(value, _) => *value,
            Tree::Variable(number) => variables[*number],
            Tree::Constant => CONSTANT.1,
            Tree::Pi => std::f64::consts::PI,
            Tree::Negative(a) => -of(a),
            Tree::Positive(a) => of(a),
            Tree::Binary(operator, a, b) => meaning::binary(operator, of(a), of(b)),
            Tree::Call(name, arguments) => {
                meaning::call(name, &arguments.iter().map(of).collect::<Vec<f64>>()).unwrap()
            }
        }
    }

    /// True if a variable occurs.
    pub fn contains(&self, number: usize) -> bool {
        match self {
            Tree::Variable(other) => *other == number,
            Tree::Negative(a) | Tree::Positive(a) => a.contains(number),
            Tree::Binary(_, a, b) => a.contains(number) || b.contains(number),
            Tree::Call(_, arguments) => arguments.iter().any(|a| a.contains(number)),
            _ => false,
        }
    }

    /// Precedence of the outermost operator: comparison 1, sum 2, product 3, sign 4, power 5, anything closed 6.
    fn strength(&self) -> u8 {
        match self {
            Tree::Binary(operator, ..) => match *operator {
                "+" | "-" => 2,
                "*" | "/" => 3,
                "^" => 5,
                _ => 1,
            },
            Tree::Negative(_) | Tree::Positive(_) => 4,
            _ => 6,
        }
    }

    /// The text of the formula.
    pub fn text(&self, spelling: &mut Spelling) -> String {
        let mut text = String::new();
        self.write(0, spelling, &mut text);
        text
    }

    /// Appends the text, in brackets if its precedence is below `least`.
    fn write(&self, least: u8, spelling: &mut Spelling, text: &mut String) {
        let brackets = usize::from(self.strength() < least) + spelling.redundant(self.strength() < 6);
        for _ in 0..brackets {
            spelling.token("(", text);
        }
        match self {
            Tree::Number(_, number) => spelling.token(number, text),
            Tree::Variable(number) => spelling.token(VARIABLES[*number], text),
            Tree::Constant => spelling.token(CONSTANT.0, text),
            Tree::Pi => spelling.token("pi", text),
            Tree::Negative(a) | Tree::Positive(a) => {
                spelling.token(if matches!(self, Tree::Negative(_)) { "-" } else { "+" }, text);
                a.write(4, spelling, text);
            }
            Tree::Binary(operator, a, b) => {
                // Sums and products group to the left, powers to the right, comparisons not at all.
                let (left, right) = match self.strength() {
                    1 => (2, 2),
                    5 => (6, 4),
                    strength => (strength, strength + 1),
                };
                a.write(left, spelling, text);
                spelling.token(operator, text);
                b.write(right, spelling, text);
            }
            Tree::Call(name, arguments) => {
                spelling.token(name, text);
                spelling.token("(", text);
                for (k, argument) in arguments.iter().enumerate() {
                    if k > 0 {
                        spelling.token(",", text);
                    }
                    argument.write(0, spelling, text);
                }
                spelling.token(")", text);
            }
        }
        for _ in 0..brackets {
            spelling.token(")", text);
        }
    }
}

/// Amount of redundant notation.
pub enum Spelling<'a> {
    /// No bracket and no space that could be left out.
    Shortest,
    /// Brackets around everything that is made of parts.
    Bracketed,
    /// Brackets and spaces at random.
    Loose(&'a mut Random),
}

impl Spelling<'_> {
    /// Number of redundant pairs of brackets.
    fn redundant(&mut self, made_of_parts: bool) -> usize {
        match self {
            Spelling::Shortest => 0,
            Spelling::Bracketed => usize::from(made_of_parts),
            Spelling::Loose(random) => {
                if random.chance(1.0 / 4.0) {
                    1 + random.below(2)
                } else {
                    0
                }
            }
        }
    }

    fn token(&mut self, token: &str, text: &mut String) {
        if let Spelling::Loose(random) = self {
            while random.chance(1.0 / 4.0) {
                text.push_str(random.pick::<&str>(&[" ", "  ", "\t", "\n", "\u{a0}", "\u{3000}"]));
            }
        }
        text.push_str(token);
    }
}
