//! What is made of results: a report as one page of HTML ([`appendix`]), and studies that run a deck for many parameters
//! ([`study`]).

pub mod appendix;
pub mod study;
