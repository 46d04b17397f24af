"""The verification pages: each module runs the decks of one page, prints its tables and draws its figures."""
