"""Other tools and our FMUs: what each takes, run by hand; the table is in fmus/in_your_tool.md."""
