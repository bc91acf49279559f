"""What is said of a diagnosis: sizes and intervals, sentences, pictures, files."""
