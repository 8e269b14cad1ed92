# SPDX-License-Identifier: Apache-2.0
"""Tables of many arrays as kernels take them: one address, not seven values for each array.

A named tuple of sixty arrays is 420 arguments to Numba, of each kernel it is handed to: seconds of
compiling. ``packed`` writes it into one block of words once, tables in it into blocks of their own.
In kernels ``table.name`` is then what it is in Python.
"""

import hashlib
from pathlib import Path
from typing import Any

# isort: off
from slam import _numba  # noqa: F401  (before anything else imports Numba)

# isort: on
import numpy as np
from llvmlite import ir
from numba import typeof, types
from numba.core import cgutils
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    NativeValue,
    infer_getattr,
    lower_getattr_generic,
    models,
    register_model,
    unbox,
)

WORD = 8  # bytes
_types: dict[Any, Any] = {}  # of arrays, by all that decides one: to find it out takes 30 us
_LAYOUT = Path(__file__).read_bytes()  # what was compiled for another one must not be found again


class TableType(types.Type):  # type: ignore[misc]  # numba has no types
    """``fields``: type and first word of each, by name."""

    def __init__(self, name: str, fields: dict[str, tuple[Any, int]]) -> None:
        self.fields = fields
        digest = hashlib.sha256(str(fields).encode() + _LAYOUT).hexdigest()[:8]
        super().__init__(f"{name}_{digest}")


register_model(TableType)(models.OpaqueModel)


class Packed:
    """A table for kernels, which keeps what it points to alive."""

    def __init__(self, table: Any) -> None:
        fields: dict[str, tuple[Any, int]] = {}
        words: list[int] = []
        self._kept: list[Any] = []
        for name, value in zip(table._fields, table, strict=True):
            start = len(words)
            fields[name] = (self._add(value, words), start)
        self._words = np.array(words, dtype=np.int64)
        self._numba_type_ = TableType(type(table).__name__, fields)
        self.address = self._words.ctypes.data

    def __reduce__(self) -> Any:
        raise TypeError("a packed table cannot be copied: it holds addresses of its arrays")

    def _add(self, value: Any, words: list[int]) -> Any:
        """Append the words of a value as Numba lays it out; its type."""
        if hasattr(value, "_fields"):
            value = Packed(value)
        if isinstance(value, tuple):
            return types.Tuple([self._add(part, words) for part in value])
        self._kept.append(value)
        if isinstance(value, Packed):
            words.append(value.address)
            return value._numba_type_
        if isinstance(value, np.ndarray):
            words += [0, 0, value.size, value.itemsize, value.ctypes.data]
            words += [*value.shape, *value.strides]
            flags = value.flags
            key = value.dtype, value.ndim, flags.c_contiguous, flags.f_contiguous, flags.writeable
            if key not in _types:
                _types[key] = typeof(value)
            return _types[key]
        if isinstance(value, float):
            words.append(int(np.float64(value).view(np.int64)))
        else:
            words.append(int(value or 0))
        return typeof(value)


def packed(table: Any) -> Any:
    """A named tuple of arrays, numbers, and tuples of these for kernels: the same names, live.

    Of a kernel that gets a field that is None, nothing after ``if field is None: return`` compiles.
    """
    return Packed(table)


@infer_getattr
class _Attributes(AttributeTemplate):  # type: ignore[misc]  # numba has no types
    key = TableType

    def generic_resolve(self, table: TableType, name: str) -> Any:
        return table.fields[name][0] if name in table.fields else None


@lower_getattr_generic(TableType)  # type: ignore[untyped-decorator]
def _get(context: Any, builder: Any, table: TableType, address: Any, name: str) -> Any:
    kind, word = table.fields[name]
    place = cgutils.pointer_add(builder, address, ir.Constant(ir.IntType(64), WORD * word))
    model = context.data_model_manager[kind]
    place = builder.bitcast(place, model.get_data_type().as_pointer())
    value = model.from_data(builder, builder.load(place))
    if isinstance(kind, types.Array):  # of nobody's memory, which saves counting who has it
        for part in range(2):
            nothing = ir.Constant(value.type.elements[part], None)
            value = builder.insert_value(value, nothing, part)
    return value


@unbox(TableType)  # type: ignore[untyped-decorator]
def _unbox(kind: Any, value: Any, c: Any) -> NativeValue:
    number = c.pyapi.object_getattr_string(value, "address")
    address = c.pyapi.long_as_longlong(number)
    c.pyapi.decref(number)
    return NativeValue(c.builder.inttoptr(address, cgutils.voidptr_t))
