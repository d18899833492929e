#include "apron/python/Arrays.h"

#include <algorithm>
#include <array>
#include <cstring>

namespace apron::python {
namespace {

using py::detail::array_proxy;
using py::detail::npy_api;

constexpr const char* kBlockCapsule = "apron.plane_block";

std::int64_t bytes_of(vm::CellType type) { return static_cast<std::int64_t>(program::cell_bytes(type)); }

// NumPy's name of the type.
std::string type_name(vm::CellType type) {
  return type == vm::CellType::kFloat32 ? "float32" : std::string(program::cell_type_name(type));
}

// The descriptor, which NumPy shares among its arrays.
const py::dtype& dtype_of(vm::CellType type) {
  static const auto* const types = new std::array<py::dtype, program::kCellTypeCount>{
      py::dtype::of<float>(), py::dtype::of<std::int32_t>(), py::dtype::of<std::uint16_t>(),
      py::dtype::of<std::uint8_t>()};  // never destroyed: Python ends first
  return (*types)[index_of(type)];
}

bool has_type(py::handle array, vm::CellType wanted) {
  PyObject* const type = array_proxy(array.ptr())->descr;
  PyObject* const other = dtype_of(wanted).ptr();
  return type == other || npy_api::get().PyArray_EquivTypes_(type, other);
}

std::string shape_text(py::handle array) {
  const auto* const a = array_proxy(array.ptr());
  std::string text;
  for (int i = 0; i < a->nd; ++i) text += (i > 0 ? ", " : "") + std::to_string(a->dimensions[i]);
  return "(" + text + (a->nd == 1 ? ",)" : ")");
}

// The block whose cells the array shows, or null. NumPy's base of a view is the array that owns the cells.
library::PlaneBlock* find_block(py::handle array) {
  PyObject* base = array_proxy(array.ptr())->base;
  if (base != nullptr && is_array(base)) base = array_proxy(base)->base;
  if (base == nullptr || PyCapsule_CheckExact(base) == 0 || PyCapsule_IsValid(base, kBlockCapsule) == 0)
    return nullptr;
  return static_cast<library::SharedBlock*>(PyCapsule_GetPointer(base, kBlockCapsule))->get();
}

// NumPy computes the strides: pybind11 before 2.12 takes wrong ones from descriptors of NumPy 2.
py::object allocate(const py::dtype& type, int dimensions, const Py_intptr_t* shape) {
  const npy_api& api = npy_api::get();
  Py_INCREF(type.ptr());  // NewFromDescr takes it
  auto array = py::reinterpret_steal<py::object>(api.PyArray_NewFromDescr_(
      api.PyArray_Type_, type.ptr(), dimensions, shape, nullptr, nullptr, 0, nullptr));
  if (!array) throw py::error_already_set();
  return array;
}

}  // namespace

bool is_array(py::handle object) noexcept { return npy_api::get().PyArray_Check_(object.ptr()); }

py::object to_cells(py::handle array, vm::CellType type, const std::string& what) {
  if (has_type(array, type)) return py::reinterpret_borrow<py::object>(array);
  const auto dtype = py::reinterpret_borrow<py::object>(array_proxy(array.ptr())->descr);
  const auto kind = py::cast<std::string>(dtype.attr("kind"));
  const auto given = py::cast<std::string>(py::str(dtype));
  if (!program::is_integer(type) && kind.find_first_of("biuf") == std::string::npos)
    throw py::type_error(what + " is an array of " + given + ": must be of booleans, integers or floats");
  if (program::is_integer(type) &&
      !py::cast<bool>(py::module_::import("numpy").attr("can_cast")(dtype, dtype_of(type), "safe")))
    throw py::type_error(what + " is an array of " + given + ": must be of " + type_name(type) +
                         ", which array.astype(numpy." + type_name(type) + ") makes");
  return array.attr("astype")(dtype_of(type));
}

ArrayView view_of(py::handle array, vm::CellType type, const std::string& what) {
  const auto* const a = array_proxy(array.ptr());
  if (a->nd != 2 && a->nd != 3)
    throw py::value_error(what + " has shape " + shape_text(array) +
                          ": must be (rows, columns), or (n, rows, columns) for n runs");
  const int first = a->nd - 2;
  ArrayView view{a->data,
                 first == 1 ? static_cast<std::int64_t>(a->dimensions[0]) : 0,
                 a->dimensions[first],
                 a->dimensions[first + 1],
                 first == 1 ? static_cast<std::int64_t>(a->strides[0]) : 0,
                 a->strides[first],
                 a->strides[first + 1],
                 nullptr,
                 type};
  if (first == 1 && view.count == 0)
    throw py::value_error(what + " has shape " + shape_text(array) + ": there is nothing to run");
  library::PlaneBlock* const block = first == 0 ? find_block(array) : nullptr;
  if (block != nullptr && view.data == reinterpret_cast<char*>(block->plane().data) &&
      block->plane().type == type && view.has_shape(block->plane().width, block->plane().height) &&
      view.column_stride == bytes_of(type) && view.row_stride == block->plane().pitch * bytes_of(type))
    view.block = block;
  return view;
}

ArrayView writable_view_of(py::handle array, vm::CellType type, const std::string& what) {
  if (!is_array(array) || !has_type(array, type))
    throw py::type_error(what + " must be an array of " + type_name(type) +
                         ", into which the result is written");
  if ((array_proxy(array.ptr())->flags & npy_api::NPY_ARRAY_WRITEABLE_) == 0)
    throw py::value_error(what + " is read-only: the result cannot be written into it");
  return view_of(array, type, what);
}

void copy_in(const ArrayView& from, std::int64_t index, vm::Plane to) noexcept {
  const std::size_t size = to.cell_bytes();
  const char* row = from.data + index * from.batch_stride;
  for (std::uint32_t y = 0; y < to.height; ++y, row += from.row_stride) {
    std::byte* const cells = to.row_bytes(y);
    if (from.column_stride == static_cast<std::int64_t>(size)) {
      std::memcpy(cells, row, to.width * size);
      continue;
    }
    const char* cell = row;
    for (std::uint32_t x = 0; x < to.width; ++x, cell += from.column_stride)
      std::memcpy(cells + x * size, cell, size);
  }
}

void copy_out(vm::ConstPlane from, const ArrayView& to, std::int64_t index) noexcept {
  const std::size_t size = from.cell_bytes();
  char* row = to.data + index * to.batch_stride;
  for (std::uint32_t y = 0; y < from.height; ++y, row += to.row_stride) {
    const std::byte* const cells = from.row_bytes(y);
    if (to.column_stride == static_cast<std::int64_t>(size)) {
      std::memcpy(row, cells, from.width * size);
      continue;
    }
    char* cell = row;
    for (std::uint32_t x = 0; x < from.width; ++x, cell += to.column_stride)
      std::memcpy(cell, cells + x * size, size);
  }
}

bool may_overlap(const ArrayView& a, const ArrayView& b) noexcept {
  const auto bounds = [](const ArrayView& view) {
    const char *first = view.data, *last = view.data;
    const auto extend = [&](std::int64_t count, std::int64_t stride) {
      (stride < 0 ? first : last) += std::max<std::int64_t>(count - 1, 0) * stride;
    };
    extend(view.count, view.batch_stride);
    extend(view.rows, view.row_stride);
    extend(view.columns, view.column_stride);
    return std::pair(first, last + bytes_of(view.type));
  };
  const auto [a_first, a_last] = bounds(a);
  const auto [b_first, b_last] = bounds(b);
  return a_first < b_last && b_first < a_last;
}

py::object new_array(std::int64_t count, std::int64_t rows, std::int64_t columns, vm::CellType type,
                     ArrayView& view) {
  const Py_intptr_t shape[] = {count, rows, columns};
  const int first = count > 0 ? 0 : 1;
  py::object array = allocate(dtype_of(type), 3 - first, shape + first);
  const std::int64_t size = bytes_of(type);
  view = {array_proxy(array.ptr())->data,
          count,
          rows,
          columns,
          rows * columns * size,
          columns * size,
          size,
          nullptr,
          type};
  return array;
}

py::object array_of(const std::vector<double>& values) {
  const Py_intptr_t shape[] = {static_cast<Py_intptr_t>(values.size())};
  py::object array = allocate(py::dtype::of<double>(), 1, shape);
  if (!values.empty())
    std::memcpy(array_proxy(array.ptr())->data, values.data(), values.size() * sizeof(double));
  return array;
}

py::object array_of(const library::SharedBlock& block) {
  const vm::Plane& plane = block->plane();
  const py::capsule owner(new library::SharedBlock(block), kBlockCapsule, [](PyObject* capsule) {
    delete static_cast<library::SharedBlock*>(PyCapsule_GetPointer(capsule, kBlockCapsule));
  });
  const std::int64_t size = bytes_of(plane.type);
  return py::array(
      dtype_of(plane.type), {static_cast<py::ssize_t>(plane.height), static_cast<py::ssize_t>(plane.width)},
      {static_cast<py::ssize_t>(plane.pitch * size), static_cast<py::ssize_t>(size)}, plane.data, owner);
}

}  // namespace apron::python
