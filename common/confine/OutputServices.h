// Outputs of a confined process as services of its broker.
#pragma once

#include <vector>

#include "common/confine/Broker.h"
#include "common/confine/Confinement.h"
#include "common/files/PreparedOutputs.h"

namespace common {

// Two services for each output, which must outlive them: to name it and to remove it.
std::vector<Broker::Service> output_services(const std::vector<PreparedOutput>&);
// The broker's first services are those of the outputs.
void use_outputs_of(Broker&, const std::vector<PreparedOutput>&);
// Lets the process write them.
void add_outputs(Confinement&, const std::vector<PreparedOutput>&);

// Removes the parts that were created and got no name. Use it where the rights to do so are.
void remove_unnamed(const std::vector<PreparedOutput>&) noexcept;

}  // namespace common
