//! Uses of results: a report as a single HTML page ([`appendix`]), and studies that run a deck for many parameter
//! values ([`study`]).

pub mod appendix;
pub mod study;
