/* Plays a case of `pidemu vectors` to a controller of your own, here my_controller.h and .c: ./play linear.csv */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include "my_controller.h"

int main(int argc, char **argv)
{
    enum { SP, PV, AUTO, MANUAL, OUTPUT = 10, CELLS };
    char line[4096], *at;
    double cell[CELLS], output;
    my_controller_state state;
    FILE *file = argc > 1 ? fopen(argv[1], "r") : NULL;
    int n, i;
    if (file == NULL || fgets(line, sizeof line, file) == NULL) /* the header */
        return 2;
    my_controller_init(&state);
    for (n = 0; fgets(line, sizeof line, file) != NULL; n++) {
        for (i = 0, at = line; i < CELLS; i++, at++) /* one comma after each cell */
            cell[i] = *at == ',' ? NAN : strtod(at, &at);
        output = my_controller_step(&my_controller_default, &state, cell[SP], cell[PV], cell[AUTO], cell[MANUAL]);
        if (output != cell[OUTPUT]) {
            printf("%s: scan %d: %.17g instead of %.17g\n", argv[1], n, output, cell[OUTPUT]);
            return 1;
        }
    }
    printf("%s: equal\n", argv[1]);
    return 0;
}
