"""What all packages may import: checks of arguments, threads, and errors in one line."""
