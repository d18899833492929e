#include "common/confine/OutputServices.h"

#include <cstddef>
#include <system_error>

#include "common/error/UserError.h"

namespace common {
namespace {

enum OutputService : std::size_t { kCreate, kName, kRemove, kOutputServices };

}  // namespace

std::vector<Broker::Service> output_services(std::vector<PreparedOutput>& outputs) {
  std::vector<Broker::Service> services;
  for (PreparedOutput& output : outputs) {
    services.emplace_back([&output] { return create_part(output).value(); });
    services.emplace_back([&output] { return name_part(output).value(); });
    services.emplace_back([&output] {
      remove_part(output);
      return 0;
    });
  }
  return services;
}

void use_outputs_of(Broker& broker, const std::vector<PreparedOutput>& outputs) {
  const auto ask = [&broker](std::size_t output, OutputService service) -> std::error_code {
    return {broker.ask(output * kOutputServices + service), std::generic_category()};
  };
  for (std::size_t i = 0; i < outputs.size(); ++i)
    if (const std::error_code error = ask(i, kCreate))
      throw UserError(outputs[i].subject + ": cannot be written: " + error.message());
  use_prepared_outputs(outputs, {[ask](std::size_t output) { return ask(output, kName); },
                                 [ask](std::size_t output) { ask(output, kRemove); }});
}

void add_outputs(Confinement& confinement, const std::vector<PreparedOutput>& outputs) {
  for (const PreparedOutput& output : outputs) confinement.write.push_back(output.part);
}

void remove_unnamed(const std::vector<PreparedOutput>& outputs) noexcept {
  for (const PreparedOutput& output : outputs)
    if (output.is_new) remove_part(output);
}

}  // namespace common
