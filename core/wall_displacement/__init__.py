"""Movements of panelled walls between two epochs: joints found, paired and measured, and the field between them."""
