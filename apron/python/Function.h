// The callable that apron.compile() returns.
#pragma once

#include <pybind11/pybind11.h>

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "apron/library/ArrayFunction.h"
#include "apron/library/ProgramSource.h"
#include "apron/python/Arrays.h"
#include "common/threads/ThreadPool.h"

namespace apron::python {

// Raises apron.Error, whose text has no control characters but line breaks and tabs.
void set_apron_error(const char* message) noexcept;

struct FunctionConfiguration {
  library::ProgramSource source;
  std::optional<std::vector<std::string>> results;               // nullopt: all registers and scalars written
  std::optional<std::pair<std::uint32_t, std::uint32_t>> shape;  // rows, columns; nullopt: the arguments'
  unsigned threads = 1;
  std::optional<std::uint64_t> ticks;
  std::string isa;  // "": the best
};

// Calls hold Python's global lock except while the program runs: several threads may call at once, each with
// an instance of the program of its own. A child process after fork() may go on calling.
class Function {
 public:
  // Throws common::UserError for errors in the program.
  explicit Function(FunctionConfiguration);
  ~Function();

  py::object call(py::handle positional, py::handle named, py::handle out);
  // For tp_call: f(A, B=…).
  static PyObject* call_object(PyObject* self, PyObject* positional, PyObject* named);

  const FunctionConfiguration& configuration() const noexcept { return configuration_; }
  std::vector<std::string> inputs() const;
  std::vector<std::string> outputs() const;  // registers, then scalars
  std::vector<std::string> results() const;
  py::dict parameters() const;
  const std::string& warnings() const noexcept { return warnings_; }

 private:
  // A name that a call may use.
  struct Name {
    enum class Kind : std::uint8_t { kRegister, kParameter };
    PyObject* key = nullptr;  // interned
    Kind kind = Kind::kRegister;
    std::uint32_t index = 0;
  };
  struct Result {
    PyObject* key = nullptr;  // interned
    bool is_scalar = false;
    std::uint32_t index = 0;
  };
  using Shape = std::pair<std::uint32_t, std::uint32_t>;  // rows, columns
  // The program for one default size.
  struct Variant {
    Shape shape;
    program::Program program;
    library::FunctionSignature signature;
    std::vector<Name> names;
    std::vector<Result> results;
    std::vector<std::uint32_t> result_registers;
    // Instances that no call uses: of one thread, and of the configuration's.
    std::vector<std::unique_ptr<library::ArrayFunction>> idle, idle_parallel;
  };
  struct Argument {
    std::uint32_t reg = 0;
    py::object array;  // null: a number
    ArrayView view;
    double number = 0.0;
  };
  struct Arguments {
    std::vector<Argument> inputs;
    library::ParameterValues parameters;
    std::int64_t count = 0;  // of runs; 0: one, without a leading axis
  };

  class Lease;  // of an instance, for one call

  std::shared_ptr<Variant> compile_variant(Shape) const;
  void name_results(Variant&) const;
  std::shared_ptr<Variant> variant_for(const Arguments&);
  std::shared_ptr<Variant> variant_of_shape(Shape);
  static const Name* find_name(const Variant&, py::handle key);
  void add_argument(const Variant&, Arguments&, const Name&, py::handle value) const;
  Arguments take_arguments(const Variant&, py::handle positional, py::handle named) const;
  void check_arguments(const Variant&, Arguments&) const;
  void add_results(const Variant&, py::handle out, const Arguments&, std::vector<py::object>& arrays,
                   std::vector<ArrayView>& views) const;
  py::object run_once(const std::shared_ptr<Variant>&, Arguments&, std::vector<py::object>& arrays,
                      std::vector<ArrayView>& views);
  py::object run_batch(const std::shared_ptr<Variant>&, Arguments&, std::vector<py::object>& arrays,
                       std::vector<ArrayView>& views);
  void abandon_threads_of_parent();
  std::string describe(const Variant&, std::uint32_t reg) const;

  FunctionConfiguration configuration_;
  vm::InstructionSet isa_;
  std::string warnings_;
  std::map<Shape, std::shared_ptr<Variant>> variants_;
  std::shared_ptr<Variant> latest_;
  std::unique_ptr<common::ThreadPool> pool_;  // for batches; null while a call uses it
  unsigned forks_ = 0;                        // of this process when the threads were started
};

}  // namespace apron::python
