/* The callback that FMUs of FMI 2.0 log through (fmi2CallbackLogger): formats as printf does, and hands the text on. */
#include <stdarg.h>
#include <stdio.h>

#define MESSAGE_BYTES 4096

void hummingbus_fmu_note(int status, const char *message);

void hummingbus_fmu_log(void *environment, const char *instance, int status, const char *category,
                        const char *message, ...) {
  char text[MESSAGE_BYTES];
  va_list arguments;
  (void)environment, (void)instance, (void)category;
  if (message == NULL) {
    return;
  }
  va_start(arguments, message);
  vsnprintf(text, sizeof text, message, arguments);
  va_end(arguments);
  hummingbus_fmu_note(status, text);
}
