// NumPy arrays as the inputs and results of a program.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <cstdint>
#include <string>
#include <vector>

#include "apron/library/PlaneBlock.h"
#include "apron/vm/Plane.h"

namespace apron::python {

namespace py = pybind11;

// The cells of a caller's array: count × rows × columns, with strides in bytes.
struct ArrayView {
  char* data = nullptr;
  std::int64_t count = 0, rows = 0, columns = 0;  // count 0: one plane, without the leading axis
  std::int64_t batch_stride = 0, row_stride = 0, column_stride = 0;
  library::PlaneBlock* block = nullptr;  // whose whole plane this is, or null
  vm::CellType type = vm::CellType::kFloat32;

  bool has_shape(std::uint32_t width, std::uint32_t height) const noexcept {
    return rows == height && columns == width;
  }
};

void copy_in(const ArrayView&, std::int64_t index, vm::Plane to) noexcept;
void copy_out(vm::ConstPlane from, const ArrayView&, std::int64_t index) noexcept;

// True if their bytes may overlap.
bool may_overlap(const ArrayView&, const ArrayView&) noexcept;

// An argument's array with the type of cells: itself, or a copy that NumPy's astype() makes. Floats take
// booleans, integers and other floats; integers take arrays whose type NumPy casts to theirs safely. Throws
// TypeError for anything else; `what` is its name in messages.
py::object to_cells(py::handle array, vm::CellType type, const std::string& what);
// The view of an array of that type and two or three dimensions. Throws ValueError otherwise.
ArrayView view_of(py::handle array, vm::CellType type, const std::string& what);
// The view of a caller's array for results: of that type, writable.
ArrayView writable_view_of(py::handle array, vm::CellType type, const std::string& what);

bool is_array(py::handle) noexcept;

// New arrays: C-contiguous; and the cells of a block, which the array keeps alive.
py::object new_array(std::int64_t count, std::int64_t rows, std::int64_t columns, vm::CellType, ArrayView&);
py::object array_of(const library::SharedBlock&);
// A copy: float64, of one dimension.
py::object array_of(const std::vector<double>&);

}  // namespace apron::python
