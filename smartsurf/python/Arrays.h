// NumPy arrays and other Python objects of the compiled part.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <span>
#include <string>
#include <utility>
#include <vector>

#include "smartsurf/scene/NamedValues.h"

namespace smartsurf::python {

namespace py = pybind11;

template <class T>
using Array = py::array_t<T, py::array::c_style>;
using scene::Metrics;

template <class T>
std::span<T> writable(Array<T>& array) {
  return std::span<T>(array.mutable_data(), array.size());
}
template <class T>
std::span<const T> readable(const Array<T>& array) {
  return std::span<const T>(array.data(), array.size());
}

inline py::dict to_dict(const Metrics& metrics) {
  py::dict out;
  for (const auto& [name, value] : metrics) out[py::str(name)] = value;
  return out;
}

}  // namespace smartsurf::python
