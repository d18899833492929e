// The compiled part of the Python package `apron` (docs/python.md).
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <memory>
#include <new>
#include <string>
#include <utility>

#include "apron/library/SurfaceProgram.h"
#include "apron/python/Function.h"
#include "common/error/UserError.h"
#include "common/text/Printable.h"
#include "common/text/Words.h"

namespace apron::python {

void set_apron_error(const char* message) noexcept {
  try {
    const py::object type = py::module_::import("apron._errors").attr("Error");
    PyErr_SetString(type.ptr(), common::printable_lines(message).c_str());
  } catch (py::error_already_set& error) {
    error.restore();
  } catch (const std::bad_alloc&) {
    PyErr_NoMemory();
  }
}

namespace {

using SharedFactory = std::shared_ptr<const common::ControllerFactory>;

std::unique_ptr<Function> make_function(std::string file, std::optional<std::string> text,
                                        std::vector<std::string> include_paths, std::string library_path,
                                        std::string original, std::optional<std::vector<std::string>> results,
                                        std::optional<std::pair<std::uint32_t, std::uint32_t>> shape,
                                        unsigned threads, std::optional<std::uint64_t> ticks,
                                        std::string isa) {
  FunctionConfiguration configuration;
  configuration.source = {std::move(file), std::move(text), std::move(include_paths), std::move(library_path),
                          std::move(original)};
  configuration.results = std::move(results);
  configuration.shape = shape;
  configuration.threads = threads;
  configuration.ticks = ticks;
  configuration.isa = std::move(isa);
  return std::make_unique<Function>(std::move(configuration));
}

py::tuple arguments_of(const Function& function) {
  const FunctionConfiguration& c = function.configuration();
  return py::make_tuple(c.source.file, c.source.text, c.source.include_paths, c.source.library_path,
                        c.source.original, c.results, c.shape, c.threads, c.ticks, c.isa);
}

// A capsule with a factory of controllers, which the package smartsurf takes.
py::capsule make_controllers(std::string file, std::string library_path,
                             std::vector<std::string> include_paths, library::ParameterValues parameters) {
  library::ProgramSource source{std::move(file), std::nullopt, std::move(include_paths),
                                std::move(library_path)};
  SharedFactory factory = library::make_controller_factory(
      std::move(source), std::move(parameters), [](std::string_view text) { common::print_output(text); });
  return py::capsule(
      new SharedFactory(std::move(factory)), common::kControllerCapsule, [](PyObject* capsule) {
        delete static_cast<SharedFactory*>(PyCapsule_GetPointer(capsule, common::kControllerCapsule));
      });
}

// An array of one plane in a block, which programs take and give without a copy.
py::object make_array(std::uint32_t rows, std::uint32_t columns, const std::string& type) {
  const auto cells = type == "float32" ? vm::CellType::kFloat32 : program::find_cell_type(type);
  if (!cells || type == "float")
    throw py::type_error("dtype = " + type + ": must be float32, int32, uint16 or uint8");
  return array_of(library::acquire_block(columns, rows, *cells));
}

}  // namespace

PYBIND11_MODULE(_core, m) {
  m.attr("__version__") = SMARTSURF_VERSION;
  // Local to this module: smartsurf has errors of its own.
  py::register_local_exception_translator([](std::exception_ptr error) {
    try {
      std::rethrow_exception(std::move(error));
    } catch (const common::UserError& user_error) {
      set_apron_error(user_error.what());
    }
  });
  m.def("make_controllers", &make_controllers);
  m.def("make_array", &make_array);
  m.attr("max_cells") = program::kMaxCells;

  py::class_<Function>(m, "Function", py::custom_type_setup([](PyHeapTypeObject* type) {
                         type->ht_type.tp_call = &Function::call_object;
                       }))
      .def(py::init(&make_function))
      .def(
          "run",
          [](Function& f, const py::dict& arguments, const py::object& out) {
            return f.call({}, arguments, out);
          },
          py::arg("arguments"), py::arg("out") = py::none())
      .def("__reduce__",
           [](const py::object& self) {
             return py::make_tuple(py::type::of(self), arguments_of(self.cast<const Function&>()));
           })
      .def("__repr__",
           [](const Function& f) {
             return "<apron.Function " + f.configuration().source.file + "(" + common::join(f.inputs()) +
                    ") -> " + common::join(f.results()) + ">";
           })
      .def_property_readonly("file", [](const Function& f) { return f.configuration().source.file; })
      .def_property_readonly("inputs", [](const Function& f) { return py::tuple(py::cast(f.inputs())); })
      .def_property_readonly("outputs", [](const Function& f) { return py::tuple(py::cast(f.outputs())); })
      .def_property_readonly("results", [](const Function& f) { return py::tuple(py::cast(f.results())); })
      .def_property_readonly("parameters", &Function::parameters)
      .def_property_readonly("warnings", &Function::warnings)
      .def_property_readonly("threads", [](const Function& f) { return f.configuration().threads; });
}

}  // namespace apron::python
