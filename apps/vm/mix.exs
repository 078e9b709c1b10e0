Code.require_file("../../support.exs", __DIR__)

defmodule Vm.MixProject do
  use Mix.Project

  def project, do: Convoy.Support.project(:vm, native: [programs: [leash: ["leash.c"]]])

  def application, do: [extra_applications: [:crypto]]
end
