defmodule Swarm.Host.Machine do
  @moduledoc """
  Finds what a machine lacks for a robot's network, for `robot check`: its interface is absent, or its own name is in no hosts
  file. Neither keeps a robot from starting.
  """
  alias Mesh.Interface

  @hosts "/etc/hosts"
  @services "/etc/nsswitch.conf"
  @name "/proc/sys/kernel/hostname"

  @doc "What this machine lacks now, one line each."
  @spec lacks(Interface.t()) :: [line :: String.t()]
  def lacks(interface) do
    trouble = Interface.trouble(interface, Interface.machine_or_none())
    network = for line <- List.wrap(trouble), do: "  NOW: no network here; #{line}"
    network ++ List.wrap(name(String.trim(read(@name)), read(@hosts), read(@services)))
  end

  # A machine without such a file has no words in it.
  defp read(path) do
    case File.read(path) do
      {:ok, text} -> text
      {:error, _reason} -> ""
    end
  end

  @doc """
  The line that the hosts file lacks; `nil` if the machine's name is there, or comes from where no name server is asked.

      iex> Swarm.Host.Machine.name("mag1", "127.0.0.1 localhost\\n", "hosts: files dns")
      "  NOW: /etc/hosts lacks the line \\"127.0.1.1 mag1\\"; without it programs here ask a name server who mag1 is, and wait for it"
      iex> Swarm.Host.Machine.name("mag1", "127.0.1.1\\tmag1.lab mag1 # this one\\n", "hosts: files dns")
      nil
      iex> Swarm.Host.Machine.name("mag1", "", "hosts: files myhostname dns")
      nil
  """
  @spec name(String.t(), hosts :: String.t(), services :: String.t()) :: String.t() | nil
  def name(name, hosts, services) do
    known = for line <- lines(hosts), [_ip | names] <- [String.split(line)], do: names
    sources = for line <- lines(services), ["hosts:" | words] <- [String.split(line)], do: words

    unless name == "" or name in List.flatten(known) or "myhostname" in List.flatten(sources) do
      ~s(  NOW: #{@hosts} lacks the line "127.0.1.1 #{name}"; without it programs here ask a name server who ) <>
        "#{name} is, and wait for it"
    end
  end

  defp lines(text), do: for(line <- String.split(text, "\n"), do: hd(String.split(line, "#")))
end
