"""Photos of facades to mock-up models."""
