"""Validates an FMU with FMPy, and steps it with the inputs of a table: FMU TABLE PERIOD_S OUTPUT… prints the outputs of each time.

The first line of TABLE has the names of inputs, every other line their values for one step.
"""

import sys

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu

fmu, table, period_s, *outputs = sys.argv[1:]
period_s = float(period_s)
problems = validate_fmu(fmu)
assert not problems, problems
description = read_model_description(fmu)
references = {variable.name: variable.valueReference for variable in description.modelVariables}
is_two = description.fmiVersion == "2.0"
slave = (FMU2Slave if is_two else FMU3Slave)(
    guid=description.guid if is_two else description.instantiationToken,
    unzipDirectory=extract(fmu),
    modelIdentifier=description.coSimulation.modelIdentifier,
    instanceName="stepped",
)
slave.instantiate()
if is_two:
    slave.setupExperiment(startTime=0.0)
slave.enterInitializationMode()
slave.exitInitializationMode()
read, write = (slave.getReal, slave.setReal) if is_two else (slave.getFloat64, slave.setFloat64)
lines = open(table).read().split()
inputs = [references[name] for name in lines[0].split(",")]
shown = [references[name] for name in outputs]
for step, line in enumerate(lines[1:]):
    print(*map(repr, read(shown)), sep=",")
    write(inputs, [float(value) for value in line.split(",")])
    slave.doStep(step * period_s, period_s)
slave.terminate()
slave.freeInstance()
