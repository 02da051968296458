#include <cstdio>

#include <lcm/lcm-cpp.hpp>
#include <relocd/localization_t.hpp>

// Prints the pose at the rate at which relocd publishes it, about 100 Hz.

struct Printer {
  void Print(const lcm::ReceiveBuffer* /*buffer*/,
             const std::string& /*channel*/,
             const relocd::localization_t* pose) {
    if (pose->status == relocd::localization_t::UNINITIALISED) return;
    std::printf("%.3f m %.3f m %.4f rad\n", pose->x_WB_m, pose->y_WB_m, pose->yaw_WB_rad);
    std::fflush(stdout);
  }
};

int main() {
  lcm::LCM lcm("udpm://239.255.76.67:7667?ttl=0");
  Printer printer;
  lcm.subscribe("LOCALIZATION", &Printer::Print, &printer);
  while (lcm.handle() == 0) {
  }
}
