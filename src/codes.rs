//! All message codes, each with the page that explains it.
//!
//! The pages are documentation files, one per code: each says what the message means and how to fix the fault, and
//! gives an example if a deck can produce the code on every machine. Tests check that the faulty example on a page
//! produces its code and that the corrected example does not.

/// A code with its page.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Page {
    /// The code, such as `D014`.
    pub code: &'static str,
    /// The page, in Markdown; its heading consists of the code and the title.
    pub text: &'static str,
}

impl Page {
    /// Meaning of the code in a few words.
    pub fn title(&self) -> &'static str {
        let heading = self.text.lines().next().unwrap_or_default();
        heading.split_once(": ").map_or(heading, |(_, title)| title)
    }
}

macro_rules! pages {
    ($($code:ident)*) => {
        &[$(Page {
            code: stringify!($code),
            text: include_str!(concat!("../docs/errors/", stringify!($code), ".md")),
        }),*]
    };
}

/// All pages, in the order of their codes: D for decks, S for the solution, R for results directories, W for warnings
/// during a run.
pub const PAGES: &[Page] = pages! {
    D001 D002 D003 D004 D005 D006 D007 D008 D009 D010 D011 D012 D013 D014 D015 D016 D017 D018 D019 D020
    D021 D022 D023 D024 D025 D026 D027 D028 D029 D030 D031 D032 D033 D034 D035 D036 D037 D038 D039 D040
    D041 D042 D043 D044 D045 D046 D047 D048 D049 D050 D051 D052 D053 D054 D055 D056
    D057 D058 D059 D060
    D061 D062 D063 D064 D065 D066 D067 D068 D069 D070
    D071 D072 D073 D074 D075 D076 D077 D078 D080 D081 D082 D090
    D091 D092 D093 D094 D095 D096 D097 D098 D099
    S001 S002 S003 S004 S005 S006 S007 S008 S009 S010 S011 S012 S013 S014 S015 S016 S017 S018 S019 S020
    R001 R002
    W001 W002 W003 W004 W005 W006 W007 W008 W009 W010 W011 W012 W013 W014 W015 W016 W017 W018 W019 W020
    W021 W022 W023 W024 W025
};

/// The page of a code, in upper or lower case.
pub fn page(code: &str) -> Option<&'static Page> {
    PAGES.iter().find(|page| page.code.eq_ignore_ascii_case(code))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::deck::diagnostic;
    use crate::quality::warning;
    use crate::{output, solver};

    #[test]
    fn every_code_has_a_page_with_its_title_and_every_page_a_code() {
        let titles: Vec<_> = PAGES.iter().map(|page| (page.code, page.title())).collect();
        assert_eq!(titles, [diagnostic::CODES, solver::CODES, output::CODES, warning::CODES].concat());
        for Page { code, text } in PAGES {
            assert!(text.starts_with(&format!("# {code}: ")), "{code}");
            assert!(text.lines().all(|line| line.chars().count() <= 120), "{code}");
        }
    }

    /// A code that is missing from the list in its module would also be missing from the pages.
    #[test]
    fn every_code_in_the_sources_has_a_page() {
        let mut folders = ["src", "crates"].map(std::path::PathBuf::from).to_vec();
        let mut found = std::collections::BTreeSet::new();
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    folders.push(path);
                } else {
                    let text = std::fs::read_to_string(path).unwrap();
                    let quoted = text.split('"').filter(|word| is_code(word));
                    found.extend(quoted.map(str::to_owned));
                }
            }
        }
        let known: std::collections::BTreeSet<_> = PAGES.iter().map(|page| page.code.to_owned()).collect();
        assert_eq!(found, known);
    }

    fn is_code(word: &str) -> bool {
        word.len() == 4
            && word.starts_with(|c: char| c.is_ascii_uppercase())
            && word[1..].bytes().all(|b| b.is_ascii_digit())
    }
}
