#pragma once

#include <string>
#include <vector>

#include "core/result.h"
#include "map_dataset.h"

namespace relocd {

/// What follows from what the input check finds.
enum class InputGate {
  kRefuse,  ///< Refusals end the command.
  kWarn,    ///< Refusals are said, and are no more than warnings.
  kOff,     ///< Nothing is checked.
};

/// `refuse`, `warn` or `off`. @return kInvalidInput for other words.
Result<InputGate> ParseInputGate(const std::string& word);

/// Checks each drive and says on stderr what is found.
///
/// @return kInvalidInput with the first refusal, under kRefuse.
Result<void> CheckDrives(const std::vector<SelectedFrames>& drives, InputGate gate, int threads);

/// `reloc map check`: the same, with summaries and findings on stdout.
///
/// @return whether nothing was refused.
bool PrintChecks(const std::vector<SelectedFrames>& drives, int threads);

}  // namespace relocd
