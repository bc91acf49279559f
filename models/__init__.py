"""The networks as ONNX files with their cards, and the training that makes them."""
