#include "apron/python/Function.h"

#include <pthread.h>

#include <algorithm>
#include <atomic>
#include <exception>

#include "apron/program/CallSite.h"
#include "apron/program/Reachability.h"
#include "apron/vm/NumberFormat.h"
#include "common/error/UserError.h"
#include "common/text/Words.h"

namespace apron::python {
namespace {

constexpr std::size_t kMaxVariants = 32;
constexpr std::uint32_t kDefaultSide = 64;  // as of apron run
// Results of arrays with fewer cells are copied, which takes less time than a block of their own.
constexpr std::size_t kMinBlockCells = 16 * 1024;

unsigned fork_count = 0;  // of this process and those that it comes from

unsigned count_forks() {
  static const int registered = pthread_atfork(nullptr, nullptr, [] { ++fork_count; });
  static_cast<void>(registered);
  return fork_count;
}

// Python runs other threads meanwhile.
class WithoutLock {
 public:
  WithoutLock() : state_(PyEval_SaveThread()) {}
  ~WithoutLock() {
    if (state_ != nullptr) PyEval_RestoreThread(state_);
  }
  WithoutLock(const WithoutLock&) = delete;
  WithoutLock& operator=(const WithoutLock&) = delete;
  // Runs Python's signal handlers. Throws if one raises.
  void check_signals() {
    PyEval_RestoreThread(std::exchange(state_, nullptr));
    const int raised = PyErr_CheckSignals();
    if (raised != 0) throw py::error_already_set();
    state_ = PyEval_SaveThread();
  }

 private:
  PyThreadState* state_;
};

void print(std::string_view text) {
  const py::gil_scoped_acquire lock;
  try {
    py::module_::import("sys").attr("stdout").attr("write")(py::str(text.data(), text.size()));
  } catch (py::error_already_set& error) {
    error.discard_as_unraisable("apron: print");
  }
}

PyObject* interned(const std::string& name) {
  PyObject* key = PyUnicode_FromStringAndSize(name.data(), static_cast<Py_ssize_t>(name.size()));
  if (key == nullptr) throw py::error_already_set();
  PyUnicode_InternInPlace(&key);
  return key;  // for the rest of the process, as all interned names of a program
}

std::string quoted(py::handle key) { return "'" + py::cast<std::string>(py::str(key)) + "'"; }

std::string list_of(const std::vector<std::string>& names) {
  return names.empty() ? "none" : common::join(names);
}

// Turns the exception that is being handled into Python's, as pybind11 does for the functions that it calls.
void set_python_error() noexcept {
  try {
    throw;
  } catch (py::error_already_set& error) {
    error.restore();
  } catch (const py::builtin_exception& error) {
    error.set_error();
  } catch (const common::UserError& error) {
    set_apron_error(error.what());
  } catch (const std::bad_alloc&) {
    PyErr_NoMemory();
  } catch (const std::exception& error) {
    PyErr_SetString(PyExc_RuntimeError, error.what());
  }
}

vm::InstructionSet find_instruction_set(const std::string& name) {
  if (name.empty()) return vm::best_instruction_set();
  const std::optional<vm::InstructionSet> isa = vm::find_instruction_set(name);
  if (!isa) throw common::UserError("isa = '" + name + "': must be 'avx512', 'avx2' or 'portable'");
  if (!vm::is_supported(*isa))
    throw common::UserError("isa = '" + name + "': this computer does not have it; its best is " +
                            std::string(vm::instruction_set_name(vm::best_instruction_set())));
  return *isa;
}

// Copies or binds the inputs of run number `index`.
template <class Inputs>
void give_inputs(library::ArrayFunction& function, const Inputs& inputs, std::int64_t index) {
  for (const auto& input : inputs) {
    if (!input.array)
      function.set_input(input.reg, input.number);
    else if (input.view.block == nullptr || !function.bind_input(input.reg, *input.view.block))
      copy_in(input.view, input.view.count > 0 ? index : 0, function.input(input.reg));
  }
}

// Ends a call of the function, whatever happens to it.
class Finish {
 public:
  explicit Finish(library::ArrayFunction& function) : function_(function) {}
  ~Finish() { function_.finish(); }
  Finish(const Finish&) = delete;
  Finish& operator=(const Finish&) = delete;

 private:
  library::ArrayFunction& function_;
};

}  // namespace

// Held with Python's lock when it begins and ends.
class Function::Lease {
 public:
  Lease(const Function& owner, std::shared_ptr<Variant> variant, unsigned threads)
      : variant_(std::move(variant)), idle_(threads > 1 ? variant_->idle_parallel : variant_->idle) {
    if (!idle_.empty()) {
      instance_ = std::move(idle_.back());
      idle_.pop_back();
      return;
    }
    library::FunctionOptions options;
    options.results = variant_->result_registers;
    options.threads = threads;
    options.isa = owner.isa_;
    options.ticks = owner.configuration_.ticks;
    instance_ = std::make_unique<library::ArrayFunction>(variant_->program, options, print);
  }
  ~Lease() { idle_.push_back(std::move(instance_)); }
  Lease(const Lease&) = delete;
  Lease& operator=(const Lease&) = delete;
  library::ArrayFunction& operator*() const noexcept { return *instance_; }
  library::ArrayFunction* operator->() const noexcept { return instance_.get(); }

 private:
  std::shared_ptr<Variant> variant_;
  std::vector<std::unique_ptr<library::ArrayFunction>>& idle_;
  std::unique_ptr<library::ArrayFunction> instance_;
};

Function::Function(FunctionConfiguration configuration)
    : configuration_(std::move(configuration)),
      isa_(find_instruction_set(configuration_.isa)),
      forks_(count_forks()) {
  const Shape shape = configuration_.shape.value_or(Shape(kDefaultSide, kDefaultSide));
  library::SizedProgram first = library::compile(configuration_.source, shape.second, shape.first);
  warnings_ = std::move(first.warnings);
  latest_ = variant_of_shape(shape);
}

Function::~Function() { abandon_threads_of_parent(); }

// The threads of the process that forked this one do not exist here and cannot be joined.
void Function::abandon_threads_of_parent() {
  if (forks_ == count_forks()) return;
  forks_ = count_forks();
  pool_.release();
  for (const auto& [shape, variant] : variants_) {
    for (auto& instance : variant->idle_parallel) instance.release();
    variant->idle_parallel.clear();
  }
}

std::shared_ptr<Function::Variant> Function::compile_variant(Shape shape) const {
  auto variant = std::make_shared<Variant>();
  variant->shape = shape;
  variant->program = library::compile(configuration_.source, shape.second, shape.first).program;
  const program::Program& program = variant->program;
  const std::string& file = configuration_.source.file;
  library::require_no_modules(program);
  if (const std::optional<std::size_t> loop = program::find_endless_loop(program))
    throw common::UserError(program::format_call_site(program, *loop) +
                            "error: the program repeats forever without a frame, which ticks= counts: "
                            "surface.step or sim.frame ends one");
  const bool ends = program::can_reach(program, program::Opcode::kEnd) ||
                    program::can_reach(program, program::Opcode::kReturn);
  if (!ends && !configuration_.ticks)
    throw common::UserError(file + ": the program repeats forever: give the number of frames, ticks=");
  variant->signature = library::find_signature(program);
  const auto add = [&](const std::string& name, Name::Kind kind, std::uint32_t index) {
    variant->names.push_back({interned(name), kind, index});
  };
  for (const auto* registers : {&variant->signature.inputs, &variant->signature.outputs})
    for (const std::uint32_t reg : *registers) add(program.registers[reg].name, Name::Kind::kRegister, reg);
  for (std::uint32_t i = 0; i < program.parameters.size(); ++i)
    add(program.parameters[i].name, Name::Kind::kParameter, i);
  name_results(*variant);
  return variant;
}

void Function::name_results(Variant& variant) const {
  const program::Program& program = variant.program;
  const auto add_register = [&](std::uint32_t reg) {
    variant.results.push_back({interned(program.registers[reg].name), false, reg});
    variant.result_registers.push_back(reg);
  };
  const auto add_scalar = [&](std::uint32_t index) {
    variant.results.push_back({interned(program.variables[index].name), true, index});
  };
  if (!configuration_.results) {
    std::ranges::for_each(variant.signature.outputs, add_register);
    std::ranges::for_each(variant.signature.scalars, add_scalar);
    return;
  }
  for (const std::string& name : *configuration_.results) {
    if (std::ranges::count(*configuration_.results, name) > 1)
      throw common::UserError(configuration_.source.file + ": results: '" + name + "' is named twice");
    const auto reg = program::find_register(program, name);
    const auto scalar = std::ranges::find_if(
        variant.signature.scalars, [&](std::uint32_t i) { return program.variables[i].name == name; });
    if (reg && !program::is_temporary(name))
      add_register(static_cast<std::uint32_t>(*reg));
    else if (scalar != variant.signature.scalars.end())
      add_scalar(*scalar);
    else
      throw common::UserError(configuration_.source.file +
                              ": results: the program has no register or scalar " +
                              program::unknown_register(program, name));
  }
}

std::shared_ptr<Function::Variant> Function::variant_of_shape(Shape shape) {
  if (latest_ != nullptr && latest_->shape == shape) return latest_;
  const auto found = variants_.find(shape);
  if (found != variants_.end()) return found->second;
  std::shared_ptr<Variant> variant = compile_variant(shape);
  if (variants_.size() >= kMaxVariants) variants_.clear();  // calls that use one keep it
  return variants_.emplace(shape, std::move(variant)).first->second;
}

const Function::Name* Function::find_name(const Variant& variant, py::handle key) {
  for (const Name& name : variant.names)
    if (name.key == key.ptr()) return &name;
  for (const Name& name : variant.names)
    if (PyUnicode_Check(key.ptr()) != 0 && PyUnicode_Compare(name.key, key.ptr()) == 0) return &name;
  return nullptr;
}

std::string Function::describe(const Variant& variant, std::uint32_t reg) const {
  return configuration_.source.file + ": " + variant.program.registers[reg].name;
}

void Function::add_argument(const Variant& variant, Arguments& arguments, const Name& name,
                            py::handle value) const {
  if (name.kind == Name::Kind::kRegister) {
    const auto reg = name.index;
    for (const Argument& earlier : arguments.inputs)
      if (earlier.reg == reg) throw py::type_error(describe(variant, reg) + " is given twice");
    if (is_array(value) && py::detail::array_proxy(value.ptr())->nd > 0) {
      Argument argument;
      argument.reg = reg;
      const vm::CellType type = variant.program.registers[reg].type;
      argument.array = to_cells(value, type, describe(variant, reg));
      argument.view = view_of(argument.array, type, describe(variant, reg));
      arguments.inputs.push_back(std::move(argument));
      return;
    }
  }
  const double number = PyFloat_AsDouble(value.ptr());
  if (number == -1.0 && PyErr_Occurred() != nullptr) {
    PyErr_Clear();
    throw py::type_error(
        configuration_.source.file + ": " + py::cast<std::string>(py::handle(name.key)) + " = " +
        py::cast<std::string>(py::repr(value)) +
        (name.kind == Name::Kind::kRegister ? ": must be an array or a number" : ": must be a number"));
  }
  if (name.kind == Name::Kind::kRegister) {
    Argument argument;
    argument.reg = name.index;
    argument.number = number;
    const vm::CellType type = variant.program.registers[name.index].type;
    if (!program::is_cell_value(type, number))
      throw py::value_error(describe(variant, name.index) + " = " + py::cast<std::string>(py::repr(value)) +
                            ": must be a whole number from " + vm::format_number(program::lowest_cell(type)) +
                            " to " + vm::format_number(program::highest_cell(type)));
    arguments.inputs.push_back(std::move(argument));
  } else {
    arguments.parameters.emplace_back(variant.program.parameters[name.index].name,
                                      static_cast<float>(number));
  }
}

Function::Arguments Function::take_arguments(const Variant& variant, py::handle positional,
                                             py::handle named) const {
  Arguments arguments;
  const Py_ssize_t count = positional ? PyTuple_GET_SIZE(positional.ptr()) : 0;
  const std::size_t input_count = variant.signature.inputs.size();
  arguments.inputs.reserve(input_count + variant.signature.outputs.size());
  if (count > std::ssize(variant.signature.inputs))
    throw py::type_error(configuration_.source.file + ": " + std::to_string(count) +
                         " arguments without a name: the program's inputs are " + list_of(inputs()));
  for (Py_ssize_t i = 0; i < count; ++i)
    add_argument(variant, arguments, variant.names[i], PyTuple_GET_ITEM(positional.ptr(), i));
  if (!named) return arguments;
  PyObject *key = nullptr, *value = nullptr;
  Py_ssize_t position = 0;
  while (PyDict_Next(named.ptr(), &position, &key, &value) != 0) {
    const Name* const name = find_name(variant, key);
    if (name == nullptr) {
      static constexpr std::string_view kOfCompile[] = {"results", "shape",    "threads", "ticks",
                                                        "include", "original", "isa"};
      const auto text = py::cast<std::string>(py::str(py::handle(key)));
      if (std::ranges::find(kOfCompile, text) != std::end(kOfCompile))
        throw py::type_error(configuration_.source.file + ": '" + text + "' is an argument of apron.compile");
      std::vector<std::string> known;
      for (const Name& one : variant.names) known.push_back(py::cast<std::string>(py::handle(one.key)));
      throw py::type_error(configuration_.source.file + ": the program has no register, slider or switch " +
                           quoted(key) + "; it has " + list_of(known));
    }
    add_argument(variant, arguments, *name, value);
  }
  return arguments;
}

// The variant for the shape of the first array whose register has the default size.
std::shared_ptr<Function::Variant> Function::variant_for(const Arguments& arguments) {
  if (configuration_.shape) return variant_of_shape(*configuration_.shape);
  for (const Argument& input : arguments.inputs) {
    const program::Register& reg = latest_->program.registers[input.reg];
    if (!input.array || Shape(reg.height, reg.width) != latest_->shape) continue;
    const ArrayView& view = input.view;
    constexpr std::int64_t kMax = program::kMaxCells;
    if (view.rows < 1 || view.columns < 1 || view.rows > kMax || view.columns > kMax ||
        view.rows * view.columns > kMax)
      throw py::value_error(describe(*latest_, input.reg) + " has " + std::to_string(view.rows) +
                            " rows and " + std::to_string(view.columns) + " columns: must have 1 to " +
                            std::to_string(kMax) + " cells");
    return variant_of_shape(
        {static_cast<std::uint32_t>(view.rows), static_cast<std::uint32_t>(view.columns)});
  }
  return latest_;
}

void Function::check_arguments(const Variant& variant, Arguments& arguments) const {
  for (const Argument& input : arguments.inputs) {
    if (!input.array) continue;
    const program::Register& reg = variant.program.registers[input.reg];
    if (!input.view.has_shape(reg.width, reg.height))
      throw py::value_error(describe(variant, input.reg) + " has " + std::to_string(input.view.rows) +
                            " rows and " + std::to_string(input.view.columns) + " columns: must have " +
                            std::to_string(reg.height) + " and " + std::to_string(reg.width));
    if (input.view.count == 0) continue;
    if (arguments.count != 0 && arguments.count != input.view.count)
      throw py::value_error(describe(variant, input.reg) + " has " + std::to_string(input.view.count) +
                            " planes, another input has " + std::to_string(arguments.count));
    arguments.count = input.view.count;
  }
  for (const auto& [name, value] : arguments.parameters)
    if (const std::string problem = program::parameter_problem(variant.program, name, value);
        !problem.empty())
      throw py::value_error(configuration_.source.file + ": " + problem);
  for (const std::uint32_t reg : variant.signature.needed)
    if (std::ranges::find(arguments.inputs, reg, &Argument::reg) == arguments.inputs.end())
      throw py::type_error(describe(variant, reg) + " is missing: the program reads it and never writes it");
}

// The caller's arrays of `out` and new ones; null where the result is a block or a scalar.
void Function::add_results(const Variant& variant, py::handle out, const Arguments& arguments,
                           std::vector<py::object>& arrays, std::vector<ArrayView>& views) const {
  const std::size_t count = variant.results.size();
  arrays.resize(count);
  views.resize(count);
  if (out && !out.is_none()) {
    if (PyDict_Check(out.ptr()) == 0)
      throw py::type_error(configuration_.source.file + ": out must be a dict of names and arrays");
    PyObject *key = nullptr, *value = nullptr;
    Py_ssize_t position = 0;
    while (PyDict_Next(out.ptr(), &position, &key, &value) != 0) {
      const auto result = std::ranges::find_if(variant.results, [&](const Result& r) {
        return !r.is_scalar && PyUnicode_Check(key) != 0 && PyUnicode_Compare(r.key, key) == 0;
      });
      if (result == variant.results.end())
        throw py::type_error(configuration_.source.file + ": out: " + quoted(key) + " is no register among " +
                             list_of(results()));
      const std::string what = configuration_.source.file + ": out[" + quoted(key) + "]";
      const program::Register& reg = variant.program.registers[result->index];
      const std::size_t i = result - variant.results.begin();
      views[i] = writable_view_of(value, reg.type, what);
      if (!views[i].has_shape(reg.width, reg.height) || views[i].count != arguments.count)
        throw py::value_error(what + " must have the shape (" +
                              (arguments.count > 0 ? std::to_string(arguments.count) + ", " : std::string()) +
                              std::to_string(reg.height) + ", " + std::to_string(reg.width) + ")");
      arrays[i] = py::reinterpret_borrow<py::object>(value);
    }
  }
  for (std::size_t i = 0; i < count; ++i) {
    if (arrays[i] || variant.results[i].is_scalar) continue;
    const program::Register& reg = variant.program.registers[variant.results[i].index];
    const bool is_input = std::ranges::find(variant.signature.inputs, variant.results[i].index) !=
                          variant.signature.inputs.end();
    if (is_input || arguments.count > 0 || std::size_t{reg.width} * reg.height < kMinBlockCells)
      arrays[i] = new_array(arguments.count, reg.height, reg.width, reg.type, views[i]);
  }
}

py::object Function::run_once(const std::shared_ptr<Variant>& shared, Arguments& arguments,
                              std::vector<py::object>& arrays, std::vector<ArrayView>& views) {
  const Variant& variant = *shared;
  const Lease instance(*this, shared, configuration_.threads);
  std::vector<library::SharedBlock> blocks;
  {
    WithoutLock unlocked;
    const Finish finish(*instance);
    instance->start(std::move(arguments.parameters));
    give_inputs(*instance, arguments.inputs, 0);
    for (std::size_t i = 0; i < variant.results.size(); ++i)
      if (arrays[i] && views[i].block != nullptr &&
          instance->bind_result(variant.results[i].index, *views[i].block))
        views[i].data = nullptr;  // there is nothing to copy
    while (instance->advance()) unlocked.check_signals();
    for (std::size_t i = 0; i < variant.results.size(); ++i) {
      const Result& result = variant.results[i];
      if (result.is_scalar) continue;
      if (!arrays[i])
        blocks.push_back(instance->take_result(result.index));
      else if (views[i].data != nullptr)
        copy_out(instance->result(result.index), views[i], 0);
    }
  }
  auto results = py::reinterpret_steal<py::object>(PyDict_New());
  if (!results) throw py::error_already_set();
  auto block = blocks.begin();
  for (std::size_t i = 0; i < variant.results.size(); ++i) {
    const Result& result = variant.results[i];
    py::object value;
    if (result.is_scalar)
      value = py::reinterpret_steal<py::object>(PyFloat_FromDouble(instance->variable(result.index)));
    else
      value = arrays[i] ? std::move(arrays[i]) : array_of(*block++);
    if (PyDict_SetItem(results.ptr(), result.key, value.ptr()) != 0) throw py::error_already_set();
  }
  return results;
}

py::object Function::run_batch(const std::shared_ptr<Variant>& shared, Arguments& arguments,
                               std::vector<py::object>& arrays, std::vector<ArrayView>& views) {
  const Variant& variant = *shared;
  const std::size_t count = arguments.count;
  const unsigned threads = count > 1 ? configuration_.threads : 1;
  // A result must not overwrite the input of another run.
  for (Argument& input : arguments.inputs)
    if (input.array && std::ranges::any_of(views, [&](const ArrayView& view) {
          return view.data != nullptr && may_overlap(view, input.view);
        })) {
      input.array = input.array.attr("copy")();
      input.view = view_of(input.array, input.view.type, "");
    }
  std::vector<std::unique_ptr<Lease>> instances;
  for (unsigned i = 0; i < threads; ++i) instances.push_back(std::make_unique<Lease>(*this, shared, 1));
  std::vector<std::vector<double>> scalars(variant.results.size());
  for (std::size_t r = 0; r < scalars.size(); ++r)
    if (variant.results[r].is_scalar) scalars[r].resize(count);
  std::atomic<bool> interrupted{false};
  const auto run = [&](std::size_t index, library::ArrayFunction& function, const auto& check_signals) {
    const Finish finish(function);
    function.start(arguments.parameters);
    give_inputs(function, arguments.inputs, static_cast<std::int64_t>(index));
    while (function.advance()) {
      if (interrupted) return;
      check_signals();
    }
    for (std::size_t r = 0; r < variant.results.size(); ++r) {
      if (variant.results[r].is_scalar)
        scalars[r][index] = function.variable(variant.results[r].index);
      else
        copy_out(function.result(variant.results[r].index), views[r], static_cast<std::int64_t>(index));
    }
  };
  // The first of the runs that fail is reported, for any number of threads; an interrupt comes before all.
  struct Failure {
    std::size_t run = SIZE_MAX;
    std::exception_ptr error;
  };
  std::vector<Failure> failures(threads);
  std::unique_ptr<common::ThreadPool> pool = std::move(pool_);
  if (threads > 1 && !pool) pool = std::make_unique<common::ThreadPool>(static_cast<int>(threads));
  {
    WithoutLock unlocked;
    const auto run_one = [&](std::uint32_t index, unsigned thread) noexcept {
      if (interrupted) return;
      bool in_check = false;
      const auto check_signals = [&] {  // by the thread that called, which alone may be Python's main thread
        in_check = true;
        if (thread == 0) unlocked.check_signals();
        in_check = false;
      };
      try {
        run(index, **instances[thread], check_signals);
        constexpr std::uint32_t kRunsBetweenChecks = 64;
        if (index % kRunsBetweenChecks == 0) check_signals();
      } catch (...) {
        if (in_check) interrupted = true;
        if (failures[thread].error == nullptr || in_check)
          failures[thread] = {in_check ? 0 : index, std::current_exception()};
      }
    };
    if (threads <= 1)
      for (std::uint32_t i = 0; i < count; ++i) run_one(i, 0);
    else
      pool->parallel_for(static_cast<std::uint32_t>(count), run_one);
  }
  pool_ = std::move(pool);
  const Failure& first = *std::ranges::min_element(failures, {}, &Failure::run);
  if (interrupted) std::rethrow_exception(failures[0].error);
  if (first.error) std::rethrow_exception(first.error);
  py::dict results;
  for (std::size_t r = 0; r < variant.results.size(); ++r) {
    results[py::handle(variant.results[r].key)] =
        variant.results[r].is_scalar ? array_of(scalars[r]) : arrays[r];
  }
  return results;
}

py::object Function::call(py::handle positional, py::handle named, py::handle out) {
  abandon_threads_of_parent();
  std::shared_ptr<Variant> variant = latest_;
  Arguments arguments = take_arguments(*variant, positional, named);
  if (std::shared_ptr<Variant> fitting = variant_for(arguments); fitting != variant) {
    variant = latest_ = std::move(fitting);
    arguments = take_arguments(*variant, positional, named);
  }
  check_arguments(*variant, arguments);
  std::vector<py::object> arrays;
  std::vector<ArrayView> views;
  add_results(*variant, out, arguments, arrays, views);
  return arguments.count > 0 ? run_batch(variant, arguments, arrays, views)
                             : run_once(variant, arguments, arrays, views);
}

PyObject* Function::call_object(PyObject* self, PyObject* positional, PyObject* named) {
  static PyObject* const out_key = interned("out");
  try {
    auto& function = py::handle(self).cast<Function&>();
    const auto fixed = py::reinterpret_borrow<py::object>(
        named != nullptr ? PyDict_GetItemWithError(named, out_key) : nullptr);
    if (!fixed) return function.call(positional, named, {}).release().ptr();
    const auto rest = py::reinterpret_steal<py::dict>(PyDict_Copy(named));
    if (!rest || PyDict_DelItem(rest.ptr(), out_key) != 0) throw py::error_already_set();
    return function.call(positional, rest, fixed).release().ptr();
  } catch (...) {
    set_python_error();
    return nullptr;
  }
}

std::vector<std::string> Function::inputs() const {
  std::vector<std::string> names;
  for (const std::uint32_t reg : latest_->signature.inputs)
    names.push_back(latest_->program.registers[reg].name);
  return names;
}

std::vector<std::string> Function::outputs() const {
  std::vector<std::string> names;
  for (const std::uint32_t reg : latest_->signature.outputs)
    names.push_back(latest_->program.registers[reg].name);
  for (const std::uint32_t scalar : latest_->signature.scalars)
    names.push_back(latest_->program.variables[scalar].name);
  return names;
}

std::vector<std::string> Function::results() const {
  std::vector<std::string> names;
  for (const Result& result : latest_->results)
    names.push_back(py::cast<std::string>(py::handle(result.key)));
  return names;
}

py::dict Function::parameters() const {
  py::dict all;
  for (const program::Parameter& p : latest_->program.parameters)
    all[py::str(p.name)] = py::make_tuple(p.default_value, p.low, p.high);
  return all;
}

}  // namespace apron::python
