//! The pages that templates refer to, so that a reader without the sources can open them.

/// Name and text of a page.
macro_rules! guide {
    ($name:literal) => {
        ($name, include_str!(concat!("../../../docs/how-to/", $name, ".md")))
    };
}

/// Where the pages lie in the sources.
const FOLDER: &str = "docs/how-to/";

const GUIDES: &[(&str, &str)] = &[
    guide!("bearing"),
    guide!("cone"),
    guide!("footing"),
    guide!("pipe"),
    guide!("plough"),
    guide!("slope"),
    guide!("stages"),
    guide!("triaxial"),
];

/// The text of a page.
pub fn guide(name: &str) -> Option<&'static str> {
    GUIDES.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}

/// A text in which the pages are named by the command that prints them.
pub fn with_commands(text: &str) -> String {
    GUIDES.iter().fold(text.to_owned(), |text, (name, _)| {
        text.replace(&format!("{FOLDER}{name}.md"), &format!("`mpm explain {name}`"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_are_named_by_their_command() {
        let text = "# The page docs/how-to/pipe.md explains this deck.";
        assert_eq!(with_commands(text), "# The page `mpm explain pipe` explains this deck.");
        assert!(guide("pipe").is_some_and(|page| page.starts_with("# ")) && guide("piper").is_none());
    }
}
