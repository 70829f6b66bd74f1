"""Language models behind one method: hosted, behind a server, in this process, replayed, or by hand."""
