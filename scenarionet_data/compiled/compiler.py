# mypy: disable-error-code="attr-defined, misc, no-untyped-call"
"""The compiler of loops over arrays: Numba's, without the work that functions which create no arrays do not need.

It is used with the versions of Numba that it was tested with, see ``gate``.
The first reset and step of a simulation compile 45 functions; with Numba's own compiler that takes over twice as long.
What is left out or done differently, with its share of that time:

* Variables assigned once stay values. Numba gives each that is used in several blocks a place in memory, and copies
  whole tuples of arrays to and from it (a quarter).
* An element of an array is read and written in 10 instructions instead of 40 (a tenth).
* Device functions are optimised where they end up, in kernels: not before, and without machine code of their own (a
  tenth). Kernels are optimised once, as there are no reference counts to remove in between.
* The types of calls of built-in functions are looked up once for the same arguments, not once per call (a tenth).
* No passes for closures, inlining, array expressions and lifetimes of variables (a tenth).
"""

from __future__ import annotations

import operator
from typing import Any

import numpy as np
from llvmlite import binding
from llvmlite import ir as llvm
from numba import _dynfunc, types
from numba.core import (
    analysis,
    cgutils,
    codegen,
    compiler,
    errors,
    fastmathpass,
    funcdesc,
    ir,
    ir_utils,
    lowering,
    transforms,
    typed_passes,
    untyped_passes,
)
from numba.core.analysis import rewrite_semantic_constants
from numba.core.cpu_options import FastMathOptions
from numba.core.rewrites import rewrite_registry
from numba.core.ssa import reconstruct_ssa
from numba.core.targetconfig import ConfigStack
from numba.core.typing import Context, signature
from numba.np import arrayobj

_FUSED = FastMathOptions({"contract"})

_MEMINFO, _PARENT, _COUNT, _ITEMSIZE, _DATA, _SHAPE, _STRIDES = range(7)
"""Members of Numba's structure of an array."""


def loop_compiler(*, in_lanes: bool = False, is_wide: bool = False) -> Any:
    """Return the compiler class for functions that create no arrays.

    Args:
        in_lanes: No memory that the function writes to is reached by two of its arguments, and its constants are
            float32.
        is_wide: A kernel with loops in lanes that are long enough for vectors of 64 bytes.
    """
    if is_wide:
        return WideCompiler
    return LaneCompiler if in_lanes else LoopCompiler


class LoopCompiler(compiler.CompilerBase):
    """Compiles one function for one combination of argument types."""

    is_in_lanes = False
    is_wide = False

    def __init__(self, typing_context: Any, *rest: Any) -> None:
        super().__init__(typing_context, *rest)
        self.state.typingctx = _Typing(typing_context)

    def define_pipelines(self) -> list[Any]:
        """Return no pipelines: their bookkeeping between passes takes longer than some passes."""
        return []

    def _compile_core(self) -> Any:
        state = self.state
        if state.func_id.is_generator or state.func_id.code.co_exceptiontable:
            raise errors.UnsupportedError(
                f"{state.func_id.func_qualname}() has a yield, with or try statement; declare it with allocates=True"
            )
        with ConfigStack().enter(state.flags.copy()):
            _translate(state)
            if self.is_in_lanes:
                state.flags.noalias = True
                _shorten_constants(state.func_ir)
            typed_passes.NopythonTypeInference().run_pass(state)
            state.func_ir = typed_passes.PreLowerStripPhis()._strip_phi_nodes(state.func_ir)
            state.cr = _lower(state, is_in_lanes=self.is_in_lanes, is_wide=self.is_wide)
        state.pipeline = None
        return state.cr


class LaneCompiler(LoopCompiler):
    """Compiles functions for the processor to compute several elements at once, of 4 bytes rather than 8."""

    is_in_lanes = True
    is_wide = True


class WideCompiler(LoopCompiler):
    """Compiles kernels with wide vectors, as the functions in lanes that end up in them."""

    is_wide = True


class _Typing(Context):
    """Numba's typing context with a memory: an operator has dozens of overloads, which are tried one by one."""

    def __init__(self, original: Any) -> None:
        self.__dict__ = original.__dict__
        self._hash = hash(original)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Context) and self.__dict__ is other.__dict__

    def __hash__(self) -> int:
        return self._hash

    def resolve_function_type(self, func: Any, args: Any, kws: Any) -> Any:
        """Return the signature of a call."""
        if isinstance(func, (types.Dispatcher, types.BoundFunction)):
            return super().resolve_function_type(func, args, kws)
        function = func if isinstance(func, types.Type) else self._lookup_global(func) or func
        kinds = tuple(kind if isinstance(kind, types.Type) else repr(kind) for kind in args)  # or a constant index
        call = id(function), kinds, tuple(dict(kws).items())
        if call not in _signatures:
            _signatures[call] = function, super().resolve_function_type(func, args, kws)
        return _signatures[call][1]

    def resolve_setitem(self, target: Any, index: Any, value: Any) -> Any:
        """Return the signature of an assignment to an element."""
        return self.resolve_function_type(self.resolve_value_type(operator.setitem), (target, index, value), {})


_signatures: dict[Any, tuple[Any, Any]] = {}
"""Functions and signatures of calls, by the identity of the function and the types of the arguments."""


def _translate(state: Any) -> None:
    """Translate bytecode to code with one assignment per variable."""
    untyped_passes.TranslateByteCode().run_pass(state)
    untyped_passes.FixupArgs().run_pass(state)
    code = state.func_ir
    code.blocks = transforms.canonicalize_cfg(code.blocks)
    rewrite_semantic_constants(code, state.args)
    analysis.dead_branch_prune(code, state.args)
    rewrite_registry.apply("before-inference", state)
    state.func_ir = reconstruct_ssa(code)
    state.func_ir._definitions = ir_utils.build_definitions(state.func_ir.blocks)


def _shorten_constants(code: Any) -> None:
    """Make constants float32: one float64 makes the whole expression float64."""
    for block in code.blocks.values():
        for statement in block.find_insts(ir.Assign):
            source = statement.value
            if isinstance(source, (ir.Const, ir.Global, ir.FreeVar)) and isinstance(source.value, float):
                source.value = np.float32(source.value)


def _lower(state: Any, *, is_in_lanes: bool, is_wide: bool) -> Any:
    """Return the result of a compilation, from typed code."""
    flags, context, name = state.flags, state.targetctx, state.func_id.func_qualname
    is_device = flags.no_cpython_wrapper
    library = (_DeviceLibrary if is_device else _KernelLibrary)(context.codegen(), name)
    library.enable_object_caching()
    descriptor = funcdesc.PythonFunctionDescriptor.from_specialized_function(
        state.func_ir,
        state.typemap,
        state.return_type,
        state.calltypes,
        mangler=context.mangler,
        inline=flags.forceinline,
        noalias=flags.noalias,
        abi_tags=[flags.get_mangle_string()],
    )
    with context.push_code_library(library):
        lower = _LoopLowering(context, library, descriptor, state.func_ir, metadata=state.metadata)
        lower.is_in_lanes, lower.is_wide = is_in_lanes, is_wide
        lower.lower()
        if not is_device:
            lower.create_cpython_wrapper(flags.release_gil)
    if is_device:
        library.finalize()
        module = descriptor.lookup_module()
        entry = _dynfunc.make_function(module, name, "", 0, lower.env, (library,))  # an identity that is never called
    else:
        entry = context.get_executable(library, descriptor, lower.env)
    context.insert_user_function(entry, descriptor, [library])
    return compiler.compile_result(
        typing_context=state.typingctx,
        target_context=context,
        entry_point=entry,
        typing_error=None,
        type_annotation="",
        library=library,
        call_helper=lower.call_helper,
        signature=signature(state.return_type, *state.args),
        objectmode=False,
        lifted=(),
        fndesc=descriptor,
        environment=lower.env,
        metadata=state.metadata,
        reload_init=[*state.reload_init, *library._reload_init],
    )


class _LoopLibrary(codegen.JITCodeLibrary):
    """LLVM code of a function and of those it calls."""

    def _optimize_functions(self, ll_module: Any) -> None:
        ll_module.data_layout = self._codegen._data_layout


class _DeviceLibrary(_LoopLibrary):
    """Code to link into kernels."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True


class _KernelLibrary(_LoopLibrary):
    """Code to run; the third level of optimisation takes longer, and its code is no faster."""

    def _optimize_final_module(self) -> None:
        passes, builder = self._codegen._module_pass_manager(opt=2)
        passes.run(self._final_module, builder)


class _LoopLowering(lowering.Lower):
    """Writes LLVM code of typed code without reference counts.

    Attributes:
        is_in_lanes: Whether no index counts from the end of an array, without which several elements in a row are not
            known to be neighbours, and products may be added to numbers without being rounded before.
        is_wide: Whether vectors have 64 bytes where the processor is not slowed down by them: LLVM avoids them on
            processors of Intel, of which those before Ice Lake reduced their clock rate.
    """

    is_in_lanes = False
    is_wide = False

    def lower_normal_function(self, fndesc: Any) -> None:
        """Write the function."""
        super().lower_normal_function(fndesc)
        if self.is_in_lanes:
            fastmathpass.rewrite_module(self.module, _FUSED)
        if self.is_wide and binding.get_host_cpu_features().get("avx512vbmi2"):
            set.add(self.function.attributes, '"prefer-vector-width"="512"')  # of which llvmlite knows nothing

    def _find_singly_assigned_variable(self) -> None:
        """Find variables with one assignment, in a block that precedes every block that uses them."""
        assigned: dict[str, int] = {}
        others: set[str] = set()
        for label, block in self.blocks.items():
            for statement in block.find_insts(ir.Assign):
                name = statement.target.name
                if name in assigned:
                    others.add(name)
                assigned[name] = label
        precede = analysis.compute_cfg_from_blocks(self.blocks).dominators()
        for label, names in analysis.compute_use_defs(self.blocks).usemap.items():
            others.update(
                name
                for name in names
                if name in assigned and (assigned[name] >= label or assigned[name] not in precede[label])
            )
        self._singly_assigned_vars = assigned.keys() - others
        self._blk_local_varmap: dict[str, Any] = {}

    def pre_block(self, block: Any) -> None:
        """Do nothing: there are no try statements to find, and variables get places in memory when assigned."""

    def lower_block(self, block: Any) -> None:
        """Write a block."""
        for statement in block.body:
            self.loc = statement.loc
            if isinstance(statement, ir.Assign):
                name = statement.target.name
                self.storevar(self.lower_assign(self.typeof(name), statement), name)
            elif isinstance(statement, ir.StaticSetItem) and self._is_array(statement.target):
                types_of_call = self.fndesc.calltypes[statement]
                self.lower_setitem(statement.target, statement.index_var, statement.value, types_of_call)
            else:
                self.lower_inst(statement)

    def lower_expr(self, resty: Any, expr: Any) -> Any:
        """Return the value of an expression."""
        if expr.op == "static_getitem" and self._is_array(expr.value):
            return self.lower_getitem(resty, expr, expr.value, expr.index_var, self.fndesc.calltypes[expr])
        if expr.op == "getattr" and expr.attr == "shape" and self._is_array(expr.value):
            return self.builder.extract_value(self.loadvar(expr.value.name), _SHAPE)
        return super().lower_expr(resty, expr)

    def lower_binop(self, resty: Any, expr: Any, op: Any) -> Any:
        """Return the value of an operation on two values."""
        context, signature = self.context, self.fndesc.calltypes[expr]
        try:
            implementation = context.get_function(context.typing_context.resolve_value_type(op), signature)
        except KeyError:  # the type of the function was replaced after the call was typed
            return super().lower_binop(resty, expr, op)
        sides = [
            context.cast(self.builder, self.loadvar(side.name), self.typeof(side.name), kind)
            for side, kind in zip((expr.lhs, expr.rhs), signature.args, strict=True)
        ]
        return context.cast(self.builder, implementation(self.builder, sides), signature.return_type, resty)

    def lower_getitem(self, resty: Any, expr: Any, value: Any, index: Any, signature: Any) -> Any:
        """Return an element or a row of an array."""
        places = self._places(value, index)
        if places is None:
            return super().lower_getitem(resty, expr, value, index, signature)
        kind, array = self.typeof(value.name), self.loadvar(value.name)
        pointer = self._pointer(kind, array, places)
        if len(places) < kind.ndim:
            return self._row(array, kind.ndim, len(places), pointer, resty)
        element = arrayobj.load_item(self.context, self.builder, kind, pointer)
        return self.context.cast(self.builder, element, kind.dtype, resty)

    def lower_setitem(self, target_var: Any, index_var: Any, value_var: Any, signature: Any) -> None:
        """Assign to an element of an array."""
        places, kind = self._places(target_var, index_var), self.typeof(target_var.name)
        if places is None or len(places) < kind.ndim:
            super().lower_setitem(target_var, index_var, value_var, signature)
            return
        pointer = self._pointer(kind, self.loadvar(target_var.name), places)
        value, of_value = self.loadvar(value_var.name), self.typeof(value_var.name)
        element = self.context.cast(self.builder, value, of_value, kind.dtype)
        arrayobj.store_item(self.context, self.builder, kind, element, pointer)

    def _is_array(self, variable: Any) -> bool:
        return isinstance(self.typeof(variable.name), types.Array)

    def _places(self, array: Any, index: Any) -> list[tuple[Any, Any]] | None:
        """Return types and values of integer indices; None for other indices, and with checks of bounds."""
        if not self._is_array(array) or self.context.enable_boundscheck:
            return None
        kind, value = self.typeof(index.name), self.loadvar(index.name)
        if isinstance(kind, types.Integer):
            return [(kind, value)]
        if isinstance(kind, types.BaseTuple) and all(isinstance(each, types.Integer) for each in kind.types):
            return [(each, self.builder.extract_value(value, axis)) for axis, each in enumerate(kind.types)]
        return None

    def _pointer(self, kind: Any, array: Any, places: list[tuple[Any, Any]]) -> Any:
        """Return the address of an element, or of the first of a row."""
        builder = self.builder
        sizes = [builder.extract_value(array, [_SHAPE, axis]) for axis in range(kind.ndim)]
        strides = [builder.extract_value(array, [_STRIDES, axis]) for axis in range(kind.ndim)]
        indices = [self._from_start(*place, size) for place, size in zip(places, sizes, strict=False)]
        data = builder.extract_value(array, _DATA)
        return cgutils.get_item_pointer2(self.context, builder, data, sizes, strides, kind.layout, indices)

    def _from_start(self, kind: Any, value: Any, size: Any) -> Any:
        """Return an index that may count from the end as one that counts from the start."""
        if self.is_in_lanes or (isinstance(value, llvm.Constant) and value.constant >= 0):
            return self.context.cast(self.builder, value, kind, types.intp)
        return arrayobj.fix_integer_index(self.context, self.builder, kind, value, size)

    def _row(self, array: Any, ndim: int, skipped: int, pointer: Any, kind: Any) -> Any:
        """Return a row: an array of the axes that are left after the first ``skipped``."""
        builder = self.builder
        row, count = llvm.Constant(self.context.get_value_type(kind), llvm.Undefined), None
        for place, axis in enumerate(range(skipped, ndim)):
            size = builder.extract_value(array, [_SHAPE, axis])
            count = size if count is None else builder.mul(count, size, flags=["nsw"])
            row = builder.insert_value(row, size, [_SHAPE, place])
            row = builder.insert_value(row, builder.extract_value(array, [_STRIDES, axis]), [_STRIDES, place])
        for member in (_MEMINFO, _PARENT, _ITEMSIZE):
            row = builder.insert_value(row, builder.extract_value(array, member), member)
        row = builder.insert_value(row, count, _COUNT)
        return builder.insert_value(row, pointer, _DATA)
