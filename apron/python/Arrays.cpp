#include "apron/python/Arrays.h"

#include <algorithm>
#include <cstring>

namespace apron::python {
namespace {

using py::detail::array_proxy;
using py::detail::npy_api;

constexpr const char* kBlockCapsule = "apron.plane_block";
constexpr std::int64_t kCellBytes = sizeof(float);

// The descriptor of float32, which NumPy shares among its arrays.
const py::dtype& float32_type() {
  static const auto* const type =
      new py::dtype(py::dtype::of<float>());  // never destroyed: Python ends first
  return *type;
}

bool has_float32(py::handle array) {
  PyObject* const type = array_proxy(array.ptr())->descr;
  return type == float32_type().ptr() || npy_api::get().PyArray_EquivTypes_(type, float32_type().ptr());
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

py::object to_float32(py::handle array, const std::string& what) {
  if (has_float32(array)) return py::reinterpret_borrow<py::object>(array);
  const auto dtype = py::reinterpret_borrow<py::object>(array_proxy(array.ptr())->descr);
  const auto kind = py::cast<std::string>(dtype.attr("kind"));
  if (kind.find_first_of("biuf") == std::string::npos)
    throw py::type_error(what + " is an array of " + py::cast<std::string>(py::str(dtype)) +
                         ": must be of booleans, integers or floats");
  return array.attr("astype")(float32_type());
}

ArrayView view_of(py::handle array, const std::string& what) {
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
                 nullptr};
  if (first == 1 && view.count == 0)
    throw py::value_error(what + " has shape " + shape_text(array) + ": there is nothing to run");
  library::PlaneBlock* const block = first == 0 ? find_block(array) : nullptr;
  if (block != nullptr && view.data == reinterpret_cast<char*>(block->plane().data) &&
      view.has_shape(block->plane().width, block->plane().height) && view.column_stride == kCellBytes &&
      view.row_stride == block->plane().pitch * kCellBytes)
    view.block = block;
  return view;
}

ArrayView writable_view_of(py::handle array, const std::string& what) {
  if (!is_array(array) || !has_float32(array))
    throw py::type_error(what + " must be an array of float32, into which the result is written");
  if ((array_proxy(array.ptr())->flags & npy_api::NPY_ARRAY_WRITEABLE_) == 0)
    throw py::value_error(what + " is read-only: the result cannot be written into it");
  return view_of(array, what);
}

void copy_in(const ArrayView& from, std::int64_t index, vm::Plane to) noexcept {
  const char* row = from.data + index * from.batch_stride;
  for (std::uint32_t y = 0; y < to.height; ++y, row += from.row_stride) {
    float* const cells = to.row(y);
    if (from.column_stride == kCellBytes) {
      std::memcpy(cells, row, to.width * sizeof(float));
      continue;
    }
    const char* cell = row;
    for (std::uint32_t x = 0; x < to.width; ++x, cell += from.column_stride)
      std::memcpy(&cells[x], cell, sizeof(float));
  }
}

void copy_out(vm::ConstPlane from, const ArrayView& to, std::int64_t index) noexcept {
  char* row = to.data + index * to.batch_stride;
  for (std::uint32_t y = 0; y < from.height; ++y, row += to.row_stride) {
    const float* const cells = from.row(y);
    if (to.column_stride == kCellBytes) {
      std::memcpy(row, cells, from.width * sizeof(float));
      continue;
    }
    char* cell = row;
    for (std::uint32_t x = 0; x < from.width; ++x, cell += to.column_stride)
      std::memcpy(cell, &cells[x], sizeof(float));
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
    return std::pair(first, last + kCellBytes);
  };
  const auto [a_first, a_last] = bounds(a);
  const auto [b_first, b_last] = bounds(b);
  return a_first < b_last && b_first < a_last;
}

py::object new_array(std::int64_t count, std::int64_t rows, std::int64_t columns, ArrayView& view) {
  const Py_intptr_t shape[] = {count, rows, columns};
  const int first = count > 0 ? 0 : 1;
  py::object array = allocate(float32_type(), 3 - first, shape + first);
  view = {array_proxy(array.ptr())->data, count,      rows,   columns, rows * columns * kCellBytes,
          columns * kCellBytes,           kCellBytes, nullptr};
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
  return py::array(float32_type(),
                   {static_cast<py::ssize_t>(plane.height), static_cast<py::ssize_t>(plane.width)},
                   {static_cast<py::ssize_t>(plane.pitch * kCellBytes), static_cast<py::ssize_t>(kCellBytes)},
                   plane.data, owner);
}

}  // namespace apron::python
