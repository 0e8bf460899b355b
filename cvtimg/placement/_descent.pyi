from typing import Any

def __getattr__(name: str) -> Any: ...  # signatures are in the .pyx, where Cython checks them
