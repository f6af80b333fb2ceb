"""The sources in which mutations are drawn, by room, and the tests beside each, quick ones first."""

PHYSICS_TESTS = {
    "muscles/laws/": "laws/test_limits.py laws/test_one_potential.py laws/test_never_pushes.py "
    "literature/test_force_maps.py",
    "muscles/hysteresis/": "laws/test_left_out.py test_registry.py laws/test_refusals_of_physics.py "
    "laws/test_amounts_of_elements.py "
    "laws/test_friction_is_passive.py laws/test_hysteresis_memory.py",
    "muscles/law.py": "laws/test_refusals_of_physics.py muscles/test_pressure_law.py laws/test_one_potential.py "
    "laws/test_beyond_the_range.py laws/test_inverse.py laws/test_limits.py",
    "muscles/braid.py": "laws/test_limits.py muscles/test_sleeve.py",
    "muscles/bladder.py": "laws/test_limits.py laws/test_inverse.py laws/test_one_potential.py",
    "muscles/biological.py": "laws/test_left_out.py laws/test_biological_muscle.py literature/test_gordon_and_hill.py",
    "muscles/elements.py": "laws/test_left_out.py laws/test_refusals_of_physics.py "
    "laws/test_amounts_of_elements.py laws/test_elements.py "
    "laws/test_creep.py",
    "muscles/threads.py": "laws/test_beyond_the_range.py",
    "muscles/worn_braid.py": "muscles/test_worn_braid.py bench/test_faults.py",
    "muscles/muscle.py": "laws/test_refusals_of_physics.py muscles/test_muscle.py laws/test_inverse.py "
    "muscles/test_rest_length.py",
    "components/flow.py": "laws/test_circuits.py laws/test_catalogue_flows.py",
    "components/gas.py": "laws/test_gas.py laws/test_exergy.py agreement/test_gas_against_coolprop.py",
    "pneumatics/orifice.py": "laws/test_left_out.py laws/test_catalogue_flows.py "
    "agreement/test_orifice_against_others.py "
    "laws/test_valves.py",
    "pneumatics/valves.py": "laws/test_valves.py specimens/test_valve_specimens.py",
    "pneumatics/solenoid.py": "laws/test_valves.py specimens/test_valve_specimens.py",
    "pneumatics/compressor.py": "laws/test_refusals_of_physics.py laws/test_valves.py laws/test_nan_in_nan_out.py",
    "pneumatics/tubes.py": "laws/test_circuits.py laws/test_circuit_balances.py "
    "agreement/test_circuits_against_radau.py",
    "pneumatics/volume.py": "laws/test_two_volumes.py laws/test_circuits.py laws/test_circuit_balances.py "
    "laws/test_exergy.py",
    "pneumatics/circuit.py": "laws/test_refusals_of_physics.py laws/test_exergy.py laws/test_circuits.py "
    "laws/test_circuit_balances.py assembly/test_circuit_file.py laws/test_order_of_circuits.py",
    "pneumatics/distributed/": "laws/test_tube_equations.py laws/test_refusals_of_physics.py "
    "laws/test_distributed_tube.py agreement/test_distributed_tube_against_fluids.py",
    "assembly/muscle_unit.py": "laws/test_power_of_muscles.py assembly/test_tied_muscle.py assembly/test_clamp.py "
    "laws/test_machines.py",
    "assembly/accounts.py": "bench/test_energy_of_runs.py laws/test_exergy.py laws/test_machines.py "
    "bench/test_frame.py",
    "assembly/loads/": "laws/test_power_of_loads.py laws/test_link_chain.py laws/test_machines.py bench/test_joint.py",
    "assembly/linearise.py": "laws/test_linearise.py",
    "engine/integration.py": "laws/test_refusals_of_physics.py laws/test_convergence_order.py engine/test_soundness.py "
    "simulation/test_chosen_steps.py",
    "engine/step.py": "laws/test_convergence_order.py engine/test_lowered_machines.py",
    "engine/sampled.py": "engine/test_soundness.py simulation/test_chosen_steps.py engine/test_lowered_machines.py",
    "engine/soundness.py": "engine/test_soundness.py",
    "engine/rates.py": "simulation/test_chosen_steps.py",
    "engine/prediction.py": "engine/test_prediction.py",
    "simulation/linear.py": "test_numbers_of_answers.py simulation/test_linear.py",
    "simulation/fit.py": "test_numbers_of_answers.py simulation/test_fit.py",
    "simulation/estimator.py": "simulation/test_estimator.py",
    "simulation/stepping.py": "simulation/test_slips.py simulation/test_simulation.py simulation/test_operations.py "
    "simulation/test_batch.py",
    "simulation/simulation.py": "laws/test_refusals_of_physics.py simulation/test_simulation.py "
    "simulation/test_slips.py simulation/test_operations.py",
    "analysis/loops.py": "laws/test_refusals_of_physics.py analysis/test_loops.py analysis/test_loop_residuals.py "
    "analysis/test_questions.py analysis/test_sampling.py analysis/test_history.py",
    "analysis/steps.py": "analysis/test_steps.py analysis/test_questions.py",
    "analysis/frequency.py": "test_numbers_of_answers.py analysis/test_frequency.py analysis/test_timing.py "
    "analysis/test_loops.py "
    "analysis/test_questions.py analysis/test_history.py",
    "analysis/energy/": "analysis/test_energy_cycles.py analysis/test_power.py cli/test_energy_command.py",
    "analysis/energy_accounts.py": "analysis/test_energy_accounts.py bench/test_energy_of_runs.py",
    "identification/fit.py": "identification/test_words_of_a_fit.py identification/test_ranking.py "
    "identification/test_what_data_show.py identification/test_bad_input.py identification/test_length_spread.py "
    "muscles/test_rest_length.py",
    "identification/creep_fit.py": "identification/test_creep_fit.py",
    "identification/hysteresis_fit.py": "identification/test_hysteresis_fit.py",
    "identification/circuit_fit.py": "test_numbers_of_answers.py identification/test_circuit_fit.py "
    "identification/test_standstill.py",
    "identification/ranking.py": "identification/test_words_of_a_fit.py identification/test_ranking.py "
    "report/test_fit_report.py identification/test_priors.py",
    "muscles/build.py": "muscles/test_rest_length.py specimens/test_bad_specimens.py muscles/test_muscle.py",
    "muscles/dimensions.py": "muscles/test_rest_length.py identification/test_length_spread.py",
    "muscles/learned.py": "muscles/test_learned.py",
    "muscles/sleeve.py": "muscles/test_sleeve.py",
    "pneumatics/build.py": "assembly/test_circuit_file.py laws/test_catalogue_flows.py "
    "specimens/test_valve_specimens.py",
    "components/element.py": "laws/test_modules.py laws/test_elements.py",
    "components/module.py": "laws/test_modules.py laws/test_nan_in_nan_out.py",
    "components/paths.py": "engine/test_signals.py assembly/test_machine_build.py laws/test_modules.py",
    "components/programs.py": "engine/test_kept_programs.py engine/test_packed.py",
    "components/system.py": "engine/test_signals.py laws/test_modules.py laws/test_machines.py "
    "engine/test_soundness.py "
    "laws/test_convergence_order.py",
    "assembly/build.py": "assembly/test_machine_build.py assembly/test_tied_muscle.py",
    "assembly/check.py": "assembly/test_machine_build.py assembly/test_circuit_file.py muscles/test_check.py",
    "assembly/circuit_file.py": "assembly/test_circuit_file.py",
    "assembly/circuit_parts.py": "assembly/test_circuit_file.py",
    "assembly/machine.py": "assembly/test_machine_build.py laws/test_machines.py engine/test_side_by_side.py",
    "assembly/machine_array.py": "engine/test_coupled.py laws/test_machines.py assembly/test_machine_build.py",
    "assembly/output_names.py": "assembly/test_machine_build.py",
    "assembly/pair_map.py": "laws/test_linearise.py bench/test_joint.py",
    "assembly/sentence.py": "assembly/test_circuit_file.py",
    "engine/coupled.py": "engine/test_coupled.py",
    "engine/native.py": "engine/test_lowered_machines.py engine/test_kept_programs.py engine/test_side_by_side.py",
    "engine/packed.py": "engine/test_packed.py simulation/test_mechanisms.py",
    "engine/side_by_side.py": "engine/test_side_by_side.py",
    "engine/signals.py": "engine/test_signals.py simulation/test_batch.py simulation/test_simulation.py "
    "engine/test_side_by_side.py "
    "engine/test_coupled.py",
    "simulation/air.py": "simulation/test_slips.py simulation/test_simulation.py",
    "simulation/batch.py": "simulation/test_batch.py",
    "simulation/kernel.py": "simulation/test_batch.py simulation/test_operations.py",
    "simulation/mechanisms.py": "simulation/test_loads_of_mechanisms.py simulation/test_mechanisms.py "
    "simulation/test_statics.py simulation/test_slips.py",
    "simulation/readouts.py": "simulation/test_readouts.py",
    "simulation/recorded.py": "simulation/test_simulation.py simulation/test_rollout.py simulation/test_slips.py",
    "simulation/rollout.py": "simulation/test_rollout.py",
    "analysis/_energy_samples.py": "analysis/test_energy_accounts.py bench/test_energy_of_runs.py",
    "analysis/channels.py": "analysis/test_characteristics.py analysis/test_sampling.py analysis/test_questions.py",
    "analysis/characteristics.py": "analysis/test_characteristics.py literature/test_gordon_and_hill.py test_verbs.py",
    "analysis/energy_parts.py": "analysis/test_energy_accounts.py analysis/test_power.py "
    "bench/test_energy_of_runs.py cli/test_energy_command.py",
    "analysis/lever.py": "analysis/test_lever.py",
    "analysis/lever_answers.py": "test_numbers_of_answers.py analysis/test_lever.py",
    "analysis/questions.py": "analysis/test_questions.py",
    "analysis/repeatability.py": "test_numbers_of_answers.py analysis/test_questions.py "
    "studies/test_characterisation.py "
    "analysis/test_sampling.py",
    "analysis/segments.py": "analysis/test_segments.py",
    "analysis/shortening.py": "literature/test_gordon_and_hill.py analysis/test_questions.py analysis/test_power.py",
    "identification/between.py": "identification/test_between.py specimens/test_between_muscles.py",
    "identification/calibration.py": "identification/test_posterior.py identification/test_law_error.py "
    "specimens/test_between_muscles.py",
    "identification/constraints.py": "test_numbers_of_answers.py identification/test_constraints.py",
    "identification/discrepancy.py": "identification/test_law_error.py identification/test_record_discrepancy.py",
    "identification/next_points.py": "identification/test_next_points.py",
    "identification/path_record.py": "identification/test_tension_path_fit.py "
    "identification/test_shared_hysteresis.py identification/test_hysteresis_fit.py",
    "identification/posterior.py": "identification/test_posterior.py",
    "identification/problem.py": "identification/test_bad_input.py identification/test_what_data_show.py "
    "identification/test_words_of_a_fit.py identification/test_length_spread.py identification/test_sizes.py",
    "identification/record_posterior.py": "identification/test_record_posterior.py",
    "identification/sampler.py": "identification/test_posterior.py identification/test_record_posterior.py",
    "identification/shared_hysteresis.py": "identification/test_shared_hysteresis.py cli/test_fit_friction.py",
    "identification/tension_path_fit.py": "identification/test_tension_path_fit.py "
    "identification/test_hysteresis_fit.py",
    "identification/trial.py": "identification/test_bad_trials.py identification/test_circuit_fit.py",
}
SOFTWARE_TESTS = {
    "bench/software/controllers.py": "bench/test_controllers.py bench/test_joint.py",
    "bench/software/sequencer.py": "bench/test_program_of_steps.py bench/test_manual.py bench/test_sample_loop.py "
    "bench/test_run.py",
    "bench/software/loop.py": "bench/test_interlocks.py bench/test_sample_loop.py",
    "bench/recorder.py": "bench/test_recorder.py bench/test_session.py",
    "bench/sensors.py": "bench/test_sensors.py",
    "bench/hardware/converters.py": "laws/test_left_out.py bench/test_analogue.py bench/test_rig.py "
    "bench/test_sample_loop.py",
    "recordings/recording.py": "analysis/test_segments.py analysis/test_questions.py "
    "recordings/test_tables_of_others.py recordings/test_files_of_laboratories.py recordings/test_recording.py",
    "recordings/calibration.py": "recordings/test_refusals_of_reading.py recordings/test_calibration_file.py "
    "recordings/test_calibration.py",
    "recordings/force_map.py": "recordings/test_refusals_of_reading.py recordings/test_force_map.py "
    "recordings/test_tables_of_others.py recordings/test_one_file_per_pressure.py "
    "recordings/test_files_of_laboratories.py recordings/test_bad_tables.py",
    "recordings/provenance.py": "recordings/test_differences.py recordings/test_conditions.py "
    "recordings/test_cautions.py",
    "recordings/memory.py": "recordings/test_memory.py",
    "recordings/files.py": "recordings/test_refusals_of_reading.py recordings/test_formats.py "
    "recordings/test_convert.py recordings/test_outside.py recordings/test_files_of_laboratories.py",
    "formats/columns.py": "recordings/test_refusals_of_reading.py recordings/test_files_of_laboratories.py "
    "recordings/test_files_of_others.py recordings/test_bad_records.py",
    "formats/text.py": "recordings/test_refusals_of_reading.py recordings/test_files_of_laboratories.py "
    "recordings/test_tables_of_others.py recordings/test_bad_records.py recordings/test_files_of_others.py",
    "formats/table.py": "recordings/test_refusals_of_reading.py recordings/test_formats.py "
    "recordings/test_bad_tables.py recordings/test_files_of_laboratories.py recordings/test_recording.py "
    "recordings/test_convert.py",
    "formats/store.py": "recordings/test_formats.py recordings/test_convert.py recordings/test_outside.py",
    "formats/exchange.py": "recordings/test_files_of_laboratories.py recordings/test_tables_of_others.py "
    "recordings/test_convert.py recordings/test_files_of_others.py",
    "formats/mcap.py": "recordings/test_mcap.py recordings/test_live_log.py",
    "formats/mcap_records.py": "recordings/test_mcap.py",
    "formats/messages.py": "recordings/test_mcap.py",
    "formats/live_log.py": "recordings/test_live_log.py recordings/test_mcap.py",
    "formats/ddf.py": "recordings/test_files_of_others.py",
    "formats/sidecar.py": "recordings/test_convert.py recordings/test_formats.py recordings/test_recording.py "
    "recordings/test_hostile_files.py",
    "quantities.py": "test_quantities.py habits/test_values_of_people.py",
    "answers.py": "test_answers.py test_contract_of_verbs.py test_verbs.py",
    "estimation.py": "test_estimation.py identification/test_ranking.py identification/test_bad_input.py",
    "experiments/waveforms/": "experiments/test_waveforms.py experiments/test_protocols.py",
    "experiments/amounts.py": "experiments/test_amounts.py experiments/test_protocols.py "
    "experiments/test_stimulus_trains.py experiments/test_dry_run.py",
    "experiments/protocol.py": "experiments/test_protocols.py experiments/test_stimulus_trains.py "
    "experiments/test_dry_run.py",
    "analysis/description.py": "report/test_data_sheet.py test_verbs.py",
    "batch/": "batch/test_sweep.py batch/test_sweep_cautions.py batch/test_lanes.py "
    "batch/test_variants.py batch/test_randomise.py batch/test_rest.py batch/test_distribution.py",
    "bench/biological_run.py": "bench/test_biological_run.py",
    "bench/channels.py": "bench/test_run.py engine/test_kept_programs.py",
    "bench/circuit_run.py": "cli/test_circuit.py bench/test_run.py assembly/test_circuit_file.py",
    "bench/console.py": "bench/test_words_of_a_console.py bench/test_console.py bench/test_session_proxy.py",
    "bench/hardware/backends.py": "bench/test_rig.py bench/test_connect.py",
    "bench/hardware/computer.py": "bench/test_computer.py",
    "bench/hardware/interface.py": "bench/test_connect.py bench/test_rig.py",
    "bench/hardware/plant.py": "bench/test_faults.py bench/test_run.py",
    "bench/hardware/simulated.py": "bench/test_faults.py bench/test_rig.py bench/test_clock.py "
    "bench/test_sample_loop.py",
    "bench/hardware/stand.py": "laws/test_power_of_loads.py bench/test_motor.py bench/test_rig.py",
    "bench/joint_run.py": "bench/test_joint.py",
    "bench/prepare.py": "bench/test_segments_of_a_run.py bench/test_run.py bench/test_rig.py",
    "bench/protocol_run.py": "bench/test_run.py bench/test_session.py",
    "bench/rig_file.py": "bench/test_rig.py bench/test_own_parts.py",
    "bench/run.py": "bench/test_run.py bench/test_energy_of_runs.py",
    "bench/sample_loop.py": "bench/test_sample_loop.py",
    "bench/segment.py": "bench/test_sample_loop.py bench/test_session.py bench/test_run.py bench/test_interlocks.py",
    "citations.py": "test_verbs.py cli/test_commands.py",
    "control/": "control/test_numbers_of_controllers.py control/test_scores.py "
    "control/test_controller_steps.py control/test_control_protocol.py",
    "experiments/commands.py": "experiments/test_protocols.py experiments/test_dry_run.py "
    "experiments/test_stimulus_trains.py",
    "experiments/description.py": "report/test_data_sheet.py test_verbs.py",
    "experiments/read.py": "experiments/test_protocols.py experiments/test_dry_run.py "
    "experiments/test_stimulus_trains.py bench/test_faults.py batch/test_sweep.py",
    "formats/clock.py": "analysis/test_sampling.py recordings/test_live_log.py recordings/test_mcap.py",
    "formats/crate.py": "recordings/test_crate.py",
    "formats/instruments.py": "recordings/test_files_of_laboratories.py recordings/test_files_of_others.py",
    "formats/labels.py": "recordings/test_differences.py recordings/test_files_of_laboratories.py",
    "formats/registry.py": "recordings/test_formats.py test_registry.py recordings/test_convert.py "
    "recordings/test_conditions.py",
    "recordings/calibration_file.py": "recordings/test_calibration_file.py",
    "recordings/tables.py": "recordings/test_one_file_per_pressure.py recordings/test_table_of_cases.py",
    "specimens/parts.py": "studies/test_parts.py assembly/test_circuit_file.py",
    "specimens/published.py": "specimens/test_published_muscles.py",
    "_jax.py": "test_lazy.py",
    "_lazy.py": "test_lazy.py test_public_names.py",
    "accessors.py": "test_lazy.py recordings/test_formats.py",
    "extras.py": "cli/test_extras.py",
    "verbs.py": "test_verbs.py test_contract_of_verbs.py",
}
GUARDS_TESTS = {
    "bench/software/interlocks.py": "bench/test_interlocks.py bench/test_emergency_stop.py",
    "experiments/dry_run.py": "experiments/test_dry_run.py",
    "muscles/plausible.py": "muscles/test_plausible.py muscles/test_muscle.py simulation/test_slips.py",
    "muscles/evidence.py": "muscles/test_words_about_a_law.py muscles/test_sleeve.py specimens/test_errors.py "
    "specimens/test_between_muscles.py muscles/test_contradiction.py",
    "muscles/check.py": "muscles/test_check_frictions.py muscles/test_check.py muscles/test_check_own_laws.py "
    "laws/test_closed_cycles.py",
    "slips.py": "muscles/test_plausible.py simulation/test_slips.py",
    "isolation.py": "test_isolation.py recordings/test_outside.py recordings/test_hostile_files.py",
    "registry.py": "test_registry.py test_code_in_files.py cli/test_extras.py",
    "documents.py": "test_documents.py cli/test_full_disk.py",
    "schema.py": "test_schema.py specimens/test_bad_specimens.py assembly/test_circuit_file.py",
    "web/guard.py": "browser/test_line_of_a_page.py browser/test_workspace.py browser/test_connections.py "
    "browser/test_screen_security.py",
    "web/live.py": "browser/test_line_of_a_page.py browser/test_workspace.py browser/test_connections.py",
    "specimens/model.py": "specimens/test_bad_specimens.py muscles/test_sleeve.py "
    "specimens/test_published_muscles.py specimens/test_between_muscles.py",
    "bench/session/session.py": "bench/test_session_rules.py bench/test_session.py bench/test_emergency_stop.py "
    "bench/test_session_proxy.py",
    "bench/rig.py": "bench/test_rig.py bench/test_faults.py bench/test_calibrated_run.py",
    "errors.py": "test_error_sentences.py test_quantities.py test_schema.py",
    "bench/session/continued.py": "bench/test_session_rules.py bench/test_session.py bench/test_session_proxy.py",
    "bench/session/interface.py": "bench/test_session_rules.py bench/test_session.py bench/test_emergency_stop.py",
    "bench/session/proxy.py": "bench/test_session_proxy.py",
}
HOSTS_TESTS = {
    "adapters.py": "test_gymnasium.py test_mujoco_callbacks.py test_drake.py",
    "c_source.py": "test_c_source.py test_cut_muscles.py",
    "commands.py": "test_conformance.py test_c_source.py test_opensim.py test_fmi.py",
    "conformance.py": "test_conformance.py",
    "coupling.py": "test_coupling.py test_conformance.py",
    "drake.py": "test_drake.py",
    "drake_host.py": "test_drake.py test_conformance.py",
    "fmi_description.py": "test_fmi.py",
    "fmi_export.py": "test_fmi.py",
    "fmi_host.py": "test_fmi.py test_conformance.py",
    "gymnasium/": "test_gymnasium.py",
    "mujoco_host.py": "test_mujoco_host.py test_mujoco_export.py test_conformance.py",
    "mujoco_muscles.py": "test_mujoco_callbacks.py test_mujoco_host.py test_mujoco_export.py test_statics_in_hosts.py",
    "opensim.py": "test_opensim.py test_statics_in_hosts.py",
    "part.py": "test_part_slips.py test_coupling.py test_statics_in_hosts.py test_cut_muscles.py",
    "scenarios.py": "test_conformance.py test_statics_in_hosts.py",
    "targets.py": "test_c_source.py test_ros2_export.py test_fmi.py",
    "warp_export.py": "test_warp.py",
    "warp_host.py": "test_warp.py test_conformance.py",
}
HARDWARE_TESTS = {
    "backends.py": "test_backends.py",
    "bluesky/": "test_bluesky.py",
    "calibrate/estimate.py": "calibrate/test_estimate.py test_calibration_from_readings.py",
    "calibrate/session.py": "calibrate/test_calibration_session.py test_calibration_from_readings.py",
    "calibrate/verbs.py": "test_calibration_from_readings.py test_calibrate_command.py",
    "calibrate_commands.py": "test_calibrate_command.py",
    "commissioning.py": "test_commissioning.py",
    "daq/hardware.py": "daq/test_daq_runs.py daq/test_daq_failures.py",
    "daq/simulated.py": "daq/test_daq_runs.py daq/test_daq_failures.py",
    "daq/wiring.py": "daq/test_daq_wiring.py",
    "device_commands.py": "test_backends.py test_commissioning.py test_replay.py",
    "replay.py": "test_replay.py",
    "serial_line/device.py": "serial_line/test_serial_device.py serial_line/test_serial_line.py",
    "serial_line/link.py": "serial_line/test_serial_line.py serial_line/test_serial_noise.py",
    "serial_line/messages.py": "serial_line/test_serial_frames.py serial_line/test_serial_noise.py",
    "serial_line/microcontroller.py": "serial_line/test_serial_device.py serial_line/test_serial_line.py",
}
STUDIES_TESTS = {
    "characterisation/evaluation.py": "studies/test_characterisation.py",
    "characterisation/readings.py": "studies/test_readings_on_a_rig.py studies/test_characterisation.py",
    "characterisation/stages.py": "studies/test_characterisation.py studies/test_readings_on_a_rig.py",
    "characterisation/verb.py": "studies/test_characterisation.py studies/test_readings_on_a_rig.py",
    "circuits.py": "cli/test_circuit.py test_verbs.py",
    "comparison/": "studies/test_muscle_comparison.py cli/test_compare_command.py",
    "description.py": "report/test_data_sheet.py cli/test_commands.py",
    "design.py": "studies/test_design.py",
    "diagnosis/": "studies/test_diagnosis.py",
    "fitting.py": "cli/test_fit_friction.py cli/test_next_command.py test_verbs.py",
    "joint_run.py": "cli/test_joint_command.py test_verbs.py",
    "next_measurement.py": "cli/test_next_command.py identification/test_next_points.py",
    "parts.py": "studies/test_parts.py cli/test_parts_command.py",
    "rig_run.py": "cli/test_run_command.py bench/test_run.py",
    "sizing/": "studies/test_sizing.py studies/test_sizing_days.py studies/test_sizing_from_posterior.py",
    "sweep_run.py": "cli/test_sweep_command.py",
    "tension.py": "test_verbs.py specimens/test_between_muscles.py",
    "tube_models.py": "studies/test_tube_study.py",
    "tube_study.py": "studies/test_tube_study.py",
}
# Folders of the library in which nothing is drawn, and why.
NOT_DRAWN = {
    "cli": "what a command says is held by goldens and by the contract of all commands, not by tests beside a file",
    "report": "a figure is judged by an eye; what it draws is of rooms in which mutations are drawn",
    "web": "a page is tested in a browser as a whole, for minutes; its guard and its line are among the guards",
}
# Where each room is, and its tests.
ROOMS = {
    "physics": ("src/mckibben", "tests", PHYSICS_TESTS),
    "software": ("src/mckibben", "tests", SOFTWARE_TESTS),
    "guards": ("src/mckibben", "tests", GUARDS_TESTS),
    "hosts": ("packages/mckibben-hosts/src/mckibben_hosts", "packages/mckibben-hosts/tests", HOSTS_TESTS),
    "hardware": (
        "packages/mckibben-hardware/src/mckibben_hardware",
        "packages/mckibben-hardware/tests",
        HARDWARE_TESTS,
    ),
    "studies": ("src/mckibben/studies", "tests", STUDIES_TESTS),
}
