"""The language-model agent: analyse, hypothesise, propose (paper, Sec. 3.2)."""
