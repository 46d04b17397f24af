fn main() {
    print!("{}", mpm_deck::reference::reference_markdown());
}
