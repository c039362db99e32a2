"""The networks as ONNX files, for programs that run them without torch (docs/onnx.md)."""
