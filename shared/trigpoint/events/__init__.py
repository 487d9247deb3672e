"""The facts trigpoint exchanges and keeps: past-tense, frozen, one writer each, and their wire form."""
