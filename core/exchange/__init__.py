"""Results for other tools: BCF topics, IDS checks, spreadsheets."""
