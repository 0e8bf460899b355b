from .tours import find_tour

__all__ = ["find_tour"]
